// Hand and gripper on a Canvas 2D: round bars sorted by depth, with a light, a floor and a shadow. No GPU is needed.
//
// A link is nine numbers: from x y z, to x y z (mm), the radius at either end (mm), and what it is (0 to 15: a segment of the hand; 100:
// palm; 101: the gripper's body; 200, 201, 202: finger A, B, C). z points up.

export const FINGERS = ["#56B4E9", "#E69F00", "#CC79A7"];
export const HEALTH = { good: "#009E73", doubtful: "#E69F00", lost: "#D55E00", unknown: "#8C8C8C" };
const GLYPH = { good: "", doubtful: "!", lost: "×", unknown: "?" };
const LIGHT = [-0.46, -0.89];
const EYE = 900;
const PALM = 100;

function rgb(hex) {
  const n = parseInt(hex.slice(1), 16);
  return [n >> 16, (n >> 8) & 255, n & 255];
}

// Lighter above 1, darker below.
function lit(color, by) {
  const c = color.map((v) => (by <= 1 ? v * by : v + (255 - v) * (by - 1)));
  return `rgb(${c[0] | 0} ${c[1] | 0} ${c[2] | 0})`;
}

function mixed(a, b, share) {
  return a.map((v, k) => v + (b[k] - v) * share);
}

// One picture of a body: where it is looked at from, what its floor is.
export class Stage {
  constructor(canvas, { yaw, pitch, target, span, floor }) {
    Object.assign(this, { canvas, yaw, pitch, target, span, floor });
    this.home = [yaw, pitch];
    this.mirrored = false;
    this.context = canvas.getContext("2d");
    this.ghost = document.createElement("canvas");
    this.turn();
  }

  // Turned by the pointer, or by the arrow keys.
  turn() {
    const { canvas } = this;
    let from = null;
    canvas.addEventListener("pointerdown", (event) => {
      from = [event.clientX, event.clientY, this.yaw, this.pitch];
      canvas.setPointerCapture(event.pointerId);
    });
    canvas.addEventListener("pointermove", (event) => {
      if (!from) return;
      const side = this.mirrored ? -1 : 1;
      this.yaw = from[2] + (side * (event.clientX - from[0])) / 140;
      this.lean(from[3] + (event.clientY - from[1]) / 200);
      this.moved?.();
    });
    for (const end of ["pointerup", "pointercancel"]) canvas.addEventListener(end, () => (from = null));
    canvas.addEventListener("dblclick", () => this.reset());
    canvas.addEventListener("keydown", (event) => {
      const by = { ArrowLeft: [-0.1, 0], ArrowRight: [0.1, 0], ArrowUp: [0, 0.08], ArrowDown: [0, -0.08] }[event.key];
      if (event.key === "Home") this.reset();
      if (!by) return;
      event.preventDefault();
      this.yaw += by[0];
      this.lean(this.pitch + by[1]);
      this.moved?.();
    });
  }

  lean(pitch) {
    this.pitch = Math.max(-0.15, Math.min(1.3, pitch));
  }

  reset() {
    [this.yaw, this.pitch] = this.home;
    this.moved?.();
  }

  // As many pixels as the screen has, up to twice the layout's.
  fit() {
    const { canvas } = this;
    const scale = Math.min(2, window.devicePixelRatio || 1);
    const [width, height] = [Math.round(canvas.clientWidth * scale), Math.round(canvas.clientHeight * scale)];
    if (canvas.width !== width || canvas.height !== height) {
      for (const each of [canvas, this.ghost]) [each.width, each.height] = [width, height];
    }
    this.scale = scale;
    this.zoom = (Math.min(width, height * 1.15) / this.span) * 0.98;
    this.sin = [Math.sin(this.yaw), Math.sin(this.pitch)];
    this.cos = [Math.cos(this.yaw), Math.cos(this.pitch)];
  }

  // Pixels across and down, depth (mm, away), pixels a mm.
  project(x, y, z) {
    const [dx, dy, dz] = [x - this.target[0], y - this.target[1], z - this.target[2]];
    const across = dx * this.cos[0] - dy * this.sin[0];
    const away = dx * this.sin[0] + dy * this.cos[0];
    const depth = away * this.cos[1] - dz * this.sin[1];
    const up = dz * this.cos[1] + away * this.sin[1];
    const size = (this.zoom * EYE) / (EYE + depth);
    const side = this.mirrored ? -1 : 1;
    return [this.canvas.width / 2 + side * across * size, this.canvas.height / 2 - up * size, depth, size];
  }

  // `solid`: drawn whole; `ghost`: its outline, behind; `marks`: sensors; `names`: letters beside points.
  draw({ solid = [], ghost = [], marks = [], names = [], faded = false, theme }) {
    this.fit();
    const context = this.context;
    context.clearRect(0, 0, this.canvas.width, this.canvas.height);
    context.globalAlpha = 1;
    this.ground(theme);
    this.shadow(solid, theme);
    if (ghost.length) this.outline(ghost, theme.ghost);
    const bars = solid.filter((link) => link.every((v) => v !== null)).map((link) => this.bar(link));
    const parts = bars.filter((bar) => bar.code !== PALM);
    const palm = bars.filter((bar) => bar.code === PALM);
    if (palm.length) parts.push({ depth: palm.reduce((sum, bar) => sum + bar.depth, 0) / palm.length, palm });
    for (const mark of marks) {
      const [x, y, depth, size] = this.project(...mark.at);
      parts.push({ depth: depth - 9, mark, x, y, size });
    }
    parts.sort((a, b) => b.depth - a.depth);
    context.globalAlpha = faded ? 0.45 : 1;
    for (const part of parts) {
      if (part.mark) this.sensor(part);
      else if (part.palm) this.flesh(part.palm, theme);
      else this.paint(part, theme);
    }
    context.globalAlpha = 1;
    for (const { text, at, color } of names) this.name(text, at, color);
  }

  bar(link) {
    const a = this.project(link[0], link[1], link[2]);
    const b = this.project(link[3], link[4], link[5]);
    return { a, b, ra: link[6] * a[3], rb: link[7] * b[3], depth: (a[2] + b[2]) / 2, code: link[8] };
  }

  // The outline of a bar, always turning the same way, so that many make one.
  hull(path, { a, b, ra, rb }, more = 0) {
    [ra, rb] = [Math.max(0.1, ra + more), Math.max(0.1, rb + more)];
    const [dx, dy] = [b[0] - a[0], b[1] - a[1]];
    const distance = Math.hypot(dx, dy);
    if (distance <= Math.abs(ra - rb) + 0.01) {
      const [end, radius] = ra > rb ? [a, ra] : [b, rb];
      path.moveTo(end[0] + radius, end[1]);
      path.arc(end[0], end[1], radius, 0, 2 * Math.PI);
      path.closePath();
      return;
    }
    const along = Math.atan2(dy, dx);
    const off = Math.acos((ra - rb) / distance);
    path.moveTo(a[0] + ra * Math.cos(along + off), a[1] + ra * Math.sin(along + off));
    path.arc(a[0], a[1], ra, along + off, along - off + 2 * Math.PI);
    path.arc(b[0], b[1], rb, along - off, along + off);
    path.closePath();
  }

  color(code, theme) {
    if (code >= 200) return mixed(rgb(FINGERS[code - 200] ?? FINGERS[0]), theme.metal, 0.42);
    return code === 101 ? theme.metal : theme.skin;
  }

  // Bars that are one soft body: one outline, one light over all of it, the bars only hinted at.
  flesh(bars, theme) {
    const context = this.context;
    const fill = (more, style) => {
      context.beginPath();
      for (const bar of bars) this.hull(context, bar, more);
      context.fillStyle = style;
      context.fill();
    };
    fill(1.6 * this.scale, theme.seam);
    const ends = bars.flatMap(({ a, b }) => [a, b]);
    const middle = [0, 1].map((k) => ends.reduce((sum, end) => sum + end[k], 0) / ends.length);
    const reach = Math.max(...ends.map((end) => Math.hypot(end[0] - middle[0], end[1] - middle[1])));
    const shade = context.createLinearGradient(
      middle[0] + LIGHT[0] * reach, middle[1] + LIGHT[1] * reach, middle[0] - LIGHT[0] * reach, middle[1] - LIGHT[1] * reach,
    );
    shade.addColorStop(0, lit(theme.skin, 1.12));
    shade.addColorStop(0.45, lit(theme.skin, 0.94));
    shade.addColorStop(1, lit(theme.skin, 0.56));
    fill(0, shade);
    const before = context.globalAlpha;
    context.globalAlpha = before * 0.34;
    for (const bar of [...bars].sort((one, other) => other.depth - one.depth)) this.paint(bar, theme, false);
    context.globalAlpha = before;
  }

  paint(part, theme, seam = true) {
    const context = this.context;
    const { a, b, ra, rb, depth, code } = part;
    // What is farther away is hazier.
    const haze = Math.max(0, Math.min(0.35, (depth + 40) / 500));
    const color = mixed(this.color(code, theme), theme.haze, haze);
    // A dark seam on what lies behind.
    if (seam) {
      context.beginPath();
      this.hull(context, part, 1.6 * this.scale);
      context.fillStyle = theme.seam;
      context.fill();
    }
    const [dx, dy] = [b[0] - a[0], b[1] - a[1]];
    const length = Math.hypot(dx, dy);
    const radius = Math.max(ra, rb);
    context.beginPath();
    this.hull(context, part);
    if (length < 0.55 * radius) {
      context.fillStyle = this.ball(depth === a[2] || a[2] < b[2] ? a : b, radius, color);
      context.fill();
      return;
    }
    // Across the bar, from the one edge to the other; `faces` says how much the one is turned to the light.
    const [nx, ny] = [-dy / length, dx / length];
    const faces = nx * LIGHT[0] + ny * LIGHT[1];
    const [mx, my] = [(a[0] + b[0]) / 2, (a[1] + b[1]) / 2];
    const shade = context.createLinearGradient(mx + nx * radius, my + ny * radius, mx - nx * radius, my - ny * radius);
    const bright = 0.5 - 0.3 * faces;
    shade.addColorStop(0, lit(color, 0.62 + 0.3 * faces));
    shade.addColorStop(Math.max(0.02, bright - 0.12), lit(color, 1.0 + 0.1 * Math.abs(faces)));
    shade.addColorStop(bright, lit(color, 1.3));
    shade.addColorStop(Math.min(0.98, bright + 0.2), lit(color, 0.97));
    shade.addColorStop(1, lit(color, 0.62 - 0.3 * faces));
    context.fillStyle = shade;
    context.fill();
    // The nearer end is round.
    const near = a[2] < b[2] ? [a, ra] : [b, rb];
    const tilt = Math.abs(a[2] - b[2]) * near[0][3];
    const round = Math.min(1, tilt / (length + 1));
    if (round > 0.25) {
      const before = context.globalAlpha;
      context.globalAlpha = before * Math.min(1, (round - 0.25) * 1.6);
      context.beginPath();
      context.arc(near[0][0], near[0][1], near[1], 0, 2 * Math.PI);
      context.fillStyle = this.ball(near[0], near[1], color);
      context.fill();
      context.globalAlpha = before;
    }
  }

  ball([x, y], radius, color) {
    const shade = this.context.createRadialGradient(
      x + LIGHT[0] * radius * 0.42, y + LIGHT[1] * radius * 0.42, radius * 0.05, x, y, radius * 1.05,
    );
    shade.addColorStop(0, lit(color, 1.36));
    shade.addColorStop(0.35, lit(color, 1.06));
    shade.addColorStop(0.75, lit(color, 0.78));
    shade.addColorStop(1, lit(color, 0.5));
    return shade;
  }

  // Rings on the floor, fading outwards.
  ground(theme) {
    const context = this.context;
    const ring = (radius) => {
      context.beginPath();
      for (let k = 0; k <= 72; k++) {
        const angle = (k / 36) * Math.PI;
        const at = this.project(
          this.target[0] + radius * Math.cos(angle), this.target[1] + radius * Math.sin(angle), this.floor,
        );
        k ? context.lineTo(at[0], at[1]) : context.moveTo(at[0], at[1]);
      }
    };
    const [x, y, , size] = this.project(this.target[0], this.target[1], this.floor);
    const glow = context.createRadialGradient(x, y, 1, x, y, 150 * size);
    glow.addColorStop(0, theme.floor);
    glow.addColorStop(1, "transparent");
    context.fillStyle = glow;
    ring(150);
    context.fill();
    context.lineWidth = this.scale;
    context.strokeStyle = theme.ring;
    for (const radius of [50, 90, 130]) {
      ring(radius);
      context.stroke();
    }
  }

  // What falls on the floor from the light, as one soft shape.
  shadow(links, theme) {
    const context = this.context;
    context.save();
    // The shape itself is drawn beside the canvas; only its shadow falls into it.
    const beside = 2 * this.canvas.width;
    context.translate(-beside, 0);
    context.shadowColor = theme.shadow;
    context.shadowBlur = 14 * this.scale;
    context.shadowOffsetX = beside;
    context.fillStyle = "#000";
    context.beginPath();
    const fall = (x, y, z, r) => {
      const high = z - this.floor;
      const at = this.project(x + 0.22 * high, y + 0.1 * high, this.floor);
      return [at, r * at[3]];
    };
    for (const link of links) {
      if (link.some((v) => v === null)) continue;
      const [a, ra] = fall(link[0], link[1], link[2], link[6]);
      const [b, rb] = fall(link[3], link[4], link[5], link[7]);
      this.hull(context, { a, b, ra: ra * 0.8, rb: rb * 0.8 });
    }
    context.fill();
    context.restore();
  }

  outline(links, color) {
    const sheet = this.ghost.getContext("2d");
    const parts = links.filter((link) => link.every((v) => v !== null)).map((link) => this.bar(link));
    const all = (more) => {
      sheet.beginPath();
      for (const part of parts) this.hull(sheet, part, more);
      sheet.fill();
    };
    sheet.globalCompositeOperation = "source-over";
    sheet.clearRect(0, 0, this.ghost.width, this.ghost.height);
    sheet.fillStyle = color;
    all(0.8 * this.scale);
    sheet.globalCompositeOperation = "destination-out";
    sheet.fillStyle = "rgb(0 0 0 / 0.85)";
    all(-1.1 * this.scale);
    this.context.globalAlpha = 0.9;
    this.context.drawImage(this.ghost, 0, 0);
    this.context.globalAlpha = 1;
  }

  // A sensor's case: colour and sign say how it is, the halo how sure its heading is.
  sensor({ mark, x, y, size }) {
    const context = this.context;
    const half = 3.4 * size;
    const color = HEALTH[mark.health] ?? HEALTH.unknown;
    if (mark.sigma !== null && mark.sigma !== undefined) {
      context.beginPath();
      context.arc(x, y, half + Math.min(14, 1.1 * mark.sigma) * size, 0, 2 * Math.PI);
      context.fillStyle = color + "33";
      context.fill();
    }
    context.beginPath();
    context.roundRect(x - half, y - half, 2 * half, 2 * half, half * 0.5);
    context.fillStyle = color;
    context.fill();
    context.lineWidth = 1.2 * this.scale;
    context.strokeStyle = "rgb(255 255 255 / 0.85)";
    context.stroke();
    const glyph = GLYPH[mark.health];
    if (glyph) {
      context.fillStyle = "#fff";
      context.font = `700 ${2.2 * half}px system-ui, sans-serif`;
      context.textAlign = "center";
      context.textBaseline = "middle";
      context.fillText(glyph, x, y + 0.06 * half);
    }
  }

  name(text, at, color) {
    const context = this.context;
    const [x, y] = this.project(...at);
    context.font = `600 ${13 * this.scale}px system-ui, sans-serif`;
    context.textAlign = "center";
    context.textBaseline = "middle";
    context.fillStyle = color;
    context.fillText(text, x, y);
  }
}
