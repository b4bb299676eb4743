//! Errors of joint angles, by joint.

use glove::hand::JOINT_COUNT;

/// Squares of errors by joint, degrees².
#[derive(Debug, Clone, Copy, Default)]
pub struct Tally {
    squares: [f64; JOINT_COUNT],
    n: [f64; JOINT_COUNT],
    held: f64,
}

impl Tally {
    pub fn add(&mut self, angles: &[f32; JOINT_COUNT], held: u32, truth: &[f64; JOINT_COUNT]) {
        for j in 0..JOINT_COUNT {
            if held >> j & 1 == 1 {
                self.held += 1.0;
                continue;
            }
            let off = (f64::from(angles[j]) - truth[j]).to_degrees();
            let off = (off + 180.0).rem_euclid(360.0) - 180.0;
            self.squares[j] += off * off;
            self.n[j] += 1.0;
        }
    }

    pub fn join(&mut self, other: &Self) {
        for j in 0..JOINT_COUNT {
            self.squares[j] += other.squares[j];
            self.n[j] += other.n[j];
        }
        self.held += other.held;
    }

    /// RMS over the joints that belong, degrees.
    pub fn rms(&self, belongs: impl Fn(usize) -> bool) -> f64 {
        let of = |values: &[f64; JOINT_COUNT]| -> f64 {
            (0..JOINT_COUNT)
                .filter(|&j| belongs(j))
                .map(|j| values[j])
                .sum()
        };
        (of(&self.squares) / of(&self.n).max(1.0)).sqrt()
    }

    pub fn hinges(&self) -> f64 {
        self.rms(|j| j % 5 >= 3)
    }

    /// Of the four fingers' MCP joints: flexion 0, abduction 1, twist 2.
    pub fn mcp(&self, which: usize) -> f64 {
        self.rms(|j| j >= 5 && j % 5 == which)
    }

    /// Share of the angles that were held.
    pub fn held(&self) -> f64 {
        self.held / (self.held + self.n.iter().sum::<f64>()).max(1.0)
    }

    /// Ten hinges, PIP, DIP, thumb's; MCP flexion, abduction, twist; CMC flexion, abduction, twist.
    pub fn row(&self) -> [f64; 10] {
        [
            self.hinges(),
            self.rms(|j| j >= 5 && j % 5 == 3),
            self.rms(|j| j >= 5 && j % 5 == 4),
            self.rms(|j| j == 3 || j == 4),
            self.mcp(0),
            self.mcp(1),
            self.mcp(2),
            self.rms(|j| j == 0),
            self.rms(|j| j == 1),
            self.rms(|j| j == 2),
        ]
    }
}
