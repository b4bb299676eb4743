//! The table of times: everybody in turns, many rounds, medians and minima.

use std::hint::black_box;
use std::time::Instant;

use hae::{Kernel, Map, PackedBuffer};

use crate::network::{INPUTS, LEN, Network};
use crate::peers::{Nalgebra, textbook};
#[cfg(target_arch = "x86_64")]
use crate::roof::{self, Roof};

struct Contender<'a> {
    name: String,
    /// Evaluations in a round: about a third of a millisecond.
    times: usize,
    of: Kind,
    run: Run<'a>,
    nanoseconds: Vec<f64>,
}

/// One evaluation.
type Run<'a> = Box<dyn FnMut(&[f32; 25]) + 'a>;

/// What a contender is for.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    /// A library, or another thing to compare with.
    Peer,
    Kernel(Kernel),
    #[cfg(target_arch = "x86_64")]
    Roof(Roof),
}

impl<'a> Contender<'a> {
    fn new(
        of: Kind,
        name: impl Into<String>,
        times: usize,
        run: impl FnMut(&[f32; 25]) + 'a,
    ) -> Self {
        Self {
            name: name.into(),
            times,
            of,
            run: Box::new(run),
            nanoseconds: Vec::new(),
        }
    }

    fn round(&mut self, inputs: &[[f32; 25]]) {
        let start = Instant::now();
        for n in 0..self.times {
            (self.run)(black_box(&inputs[n % INPUTS]));
        }
        self.nanoseconds
            .push(start.elapsed().as_secs_f64() * 1e9 / self.times as f64);
    }

    fn median(&self) -> f64 {
        self.nanoseconds[self.nanoseconds.len() / 2]
    }

    fn least(&self) -> f64 {
        self.nanoseconds[0]
    }
}

pub fn print(rounds: usize) -> Result<(), String> {
    let network = Network::new();
    let image = network.image();
    let map = Map::<25, 300, 4>::from_image(&image).map_err(|e| e.to_string())?;
    let mut buffers: Vec<_> = Kernel::ALL
        .iter()
        .map(|_| Box::new(PackedBuffer::<LEN>::new()))
        .collect();
    let mut contenders = peers(&network)?;
    #[cfg(target_arch = "x86_64")]
    limits(&mut contenders);
    for (kernel, buffer) in Kernel::ALL.into_iter().zip(&mut buffers) {
        let Ok(map) = map.repack_for(kernel, &mut buffer.0) else {
            continue;
        };
        let times = if kernel == Kernel::Portable {
            200
        } else {
            1000
        };
        contenders.push(Contender::new(
            Kind::Kernel(kernel),
            format!("hae, {kernel:?}"),
            times,
            move |q| {
                let _ = black_box(black_box(&map).eval(q));
            },
        ));
    }
    for _ in 0..rounds {
        contenders
            .iter_mut()
            .for_each(|contender| contender.round(&network.inputs));
    }
    contenders
        .iter_mut()
        .for_each(|contender| contender.nanoseconds.sort_by(f64::total_cmp));
    rows(&contenders);
    Ok(())
}

/// What this machine allows: every roof, and the length of a cycle.
#[cfg(target_arch = "x86_64")]
fn limits(contenders: &mut Vec<Contender<'_>>) {
    #[repr(align(64))]
    struct Words([f32; roof::WORDS]);
    let words = std::rc::Rc::new(Words([0.5; roof::WORDS]));
    for roof in Roof::all() {
        let words = words.clone();
        let kind = if roof.adds {
            "load, multiply, add"
        } else {
            "load, multiply"
        };
        contenders.push(Contender::new(
            Kind::Roof(roof),
            format!("{kind}, {:?}, {} in turn", roof.kernel, roof.streams),
            1000,
            move |q| roof.run(black_box(&words.0), q[0]),
        ));
    }
    contenders.push(Contender::new(
        Kind::Peer,
        format!("{} dependent additions, a cycle each", roof::CHAIN),
        1000,
        |_| roof::chain(),
    ));
}

fn rows(contenders: &[Contender<'_>]) {
    println!(
        "25 -> 300 -> 4, f32, one sample at a time; ns an evaluation, {} rounds in turns",
        contenders[0].nanoseconds.len()
    );
    println!(
        "{:40} {:>9} {:>9} {:>16} {:>16}",
        "", "median", "minimum", "x textbook", "% of its roof"
    );
    let textbook = &contenders[0];
    for contender in contenders.iter().filter(|c| is_shown(c, contenders)) {
        let (median, least) = (contender.median(), contender.least());
        let share = |of: &Contender<'_>| {
            format!(
                "{:.0} / {:.0}",
                100.0 * of.median() / median,
                100.0 * of.least() / least
            )
        };
        let ratio = format!(
            "{:.1} / {:.1}",
            textbook.median() / median,
            textbook.least() / least
        );
        println!(
            "{:40} {median:9.1} {least:9.1} {ratio:>16} {:>16}",
            contender.name,
            roof_of(contender, contenders).map_or(String::new(), share)
        );
    }
    println!("the last two columns: by medians / by minima");
}

/// Of the roofs only the fastest of a width.
fn is_shown(contender: &Contender<'_>, contenders: &[Contender<'_>]) -> bool {
    match contender.of {
        Kind::Peer | Kind::Kernel(_) => true,
        #[cfg(target_arch = "x86_64")]
        Kind::Roof(roof) => fastest(roof.kernel, roof.adds, contenders)
            .is_some_and(|fastest| fastest.of == contender.of),
    }
}

/// The fastest load + multiply of the kernel's width.
fn roof_of<'c, 'a>(
    contender: &Contender<'a>,
    contenders: &'c [Contender<'a>],
) -> Option<&'c Contender<'a>> {
    match contender.of {
        #[cfg(target_arch = "x86_64")]
        Kind::Kernel(kernel) => fastest(kernel, false, contenders),
        _ => None,
    }
}

#[cfg(target_arch = "x86_64")]
fn fastest<'c, 'a>(
    kernel: Kernel,
    adds: bool,
    contenders: &'c [Contender<'a>],
) -> Option<&'c Contender<'a>> {
    contenders
        .iter()
        .filter(|c| matches!(c.of, Kind::Roof(r) if r.kernel == kernel && r.adds == adds))
        .min_by(|a, b| a.median().total_cmp(&b.median()))
}

/// A library's evaluation.
type Peer = Box<dyn FnMut(&[f32; 25]) -> Result<[f32; 4], String>>;

/// Textbook first: the others are compared with it.
fn peers(network: &Network) -> Result<Vec<Contender<'_>>, String> {
    let mut y = [0.0; 4];
    let mut contenders = vec![Contender::new(
        Kind::Peer,
        "textbook loops",
        100,
        move |q| {
            let n = black_box(network);
            textbook(&n.w1, &n.b1, &n.w2, &n.b2, q, &mut y);
            black_box(&mut y);
        },
    )];
    let mut add = |name: &'static str, mut eval: Peer| {
        let (q, mut expected) = (&network.inputs[0], [0.0; 4]);
        textbook(
            &network.w1,
            &network.b1,
            &network.w2,
            &network.b2,
            q,
            &mut expected,
        );
        let y = eval(q).map_err(|error| format!("{name}: {error}"))?;
        if y.iter().zip(&expected).any(|(a, b)| (a - b).abs() > 0.01) {
            return Err(format!("{name} computes {y:?}, not {expected:?}"));
        }
        contenders.push(Contender::new(Kind::Peer, name, 100, move |q| {
            let _ = black_box(eval(q));
        }));
        Ok(())
    };
    let nalgebra = Nalgebra::new(network);
    add("nalgebra", Box::new(move |q| Ok(nalgebra.eval(q))))?;
    // A library that fails is left out of the table, not the table of the run.
    #[cfg(feature = "candle")]
    match crate::candle::Candle::new(network) {
        Ok(candle) => add(
            "candle",
            Box::new(move |q| candle.eval(q).map_err(|error| error.to_string())),
        )
        .unwrap_or_else(|error| eprintln!("left out: {error}")),
        Err(error) => eprintln!("left out: candle: {error}"),
    }
    #[cfg(feature = "tract")]
    match crate::tract::Tract::new(network) {
        Ok(mut tract) => add(
            "tract",
            Box::new(move |q| tract.eval(q).map_err(|error| error.to_string())),
        )
        .unwrap_or_else(|error| eprintln!("left out: {error}")),
        Err(error) => eprintln!("left out: tract: {error}"),
    }
    Ok(contenders)
}
