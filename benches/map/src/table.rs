//! The table of times: everybody in turns, many rounds, medians and minima.

use std::hint::black_box;
use std::time::Instant;

use hae::{Kernel, Map, PackedBuffer};

use crate::LEN;
use crate::network::{INPUTS, Network};
use crate::peers::{Nalgebra, textbook};
#[cfg(target_arch = "x86_64")]
use crate::roof::Roof;

struct Contender<'a> {
    name: String,
    /// Evaluations in a round: about a third of a millisecond.
    times: usize,
    /// The roof to compare with.
    roof: Option<usize>,
    run: Box<dyn FnMut(&[f32; 25]) + 'a>,
    nanoseconds: Vec<f64>,
}

impl<'a> Contender<'a> {
    fn new(name: impl Into<String>, times: usize, run: impl FnMut(&[f32; 25]) + 'a) -> Self {
        Self {
            name: name.into(),
            times,
            roof: None,
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
    let mut roofs = Vec::new();
    #[cfg(target_arch = "x86_64")]
    for (kernel, roof) in [
        (Kernel::Sse2, Roof::Sse2),
        (Kernel::Avx2, Roof::Avx2),
        (Kernel::Avx512, Roof::Avx512),
    ] {
        if kernel.is_supported() {
            roofs.push((kernel, contenders.len()));
            let words = Box::new(PackedBuffer::<{ 36_480 / 4 / 128 * 128 + 128 }>(
                [0.5; 9216],
            ));
            // 36,864 bytes for the 36,480 of the map: one per cent more.
            contenders.push(Contender::new(
                format!("load + multiply, {roof:?}"),
                1000,
                move |q| {
                    roof.run(black_box(&words.0), q[0]);
                },
            ));
        }
    }
    for (kernel, buffer) in Kernel::ALL.into_iter().zip(&mut buffers) {
        let Ok(map) = map.repack_for(kernel, &mut buffer.0) else {
            continue;
        };
        let times = if kernel == Kernel::Portable {
            200
        } else {
            1000
        };
        let mut contender = Contender::new(format!("hae, {kernel:?}"), times, move |q| {
            let _ = black_box(black_box(&map).eval(q));
        });
        contender.roof = roofs.iter().find(|(k, _)| *k == kernel).map(|(_, at)| *at);
        contenders.push(contender);
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

fn rows(contenders: &[Contender<'_>]) {
    println!(
        "25 -> 300 -> 4, f32, one sample at a time; ns an evaluation, {} rounds in turns",
        contenders[0].nanoseconds.len()
    );
    println!(
        "{:28} {:>9} {:>9} {:>12} {:>14}",
        "", "median", "minimum", "x textbook", "% of its roof"
    );
    let textbook = contenders[0].median();
    for contender in contenders {
        let (median, least) = (contender.median(), contender.nanoseconds[0]);
        let roof = contender.roof.map_or(String::new(), |at| {
            format!("{:.0}", 100.0 * contenders[at].median() / median)
        });
        println!(
            "{:28} {median:9.1} {least:9.1} {:12.1} {roof:>14}",
            contender.name,
            textbook / median
        );
    }
}

/// A library's evaluation.
type Peer = Box<dyn FnMut(&[f32; 25]) -> Result<[f32; 4], String>>;

/// Textbook first: the others are compared with it.
fn peers(network: &Network) -> Result<Vec<Contender<'_>>, String> {
    let mut y = [0.0; 4];
    let mut contenders = vec![Contender::new("textbook loops", 100, move |q| {
        let n = black_box(network);
        textbook(&n.w1, &n.b1, &n.w2, &n.b2, q, &mut y);
        black_box(&mut y);
    })];
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
        contenders.push(Contender::new(name, 100, move |q| {
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
