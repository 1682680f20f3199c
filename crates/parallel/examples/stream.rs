//! STREAM triad a = b + s c (McCalpin 1995): memory bandwidth in GB/s for 1, 2, … threads, best of the repetitions.
//!
//! `cargo run --release -p fibreflow-parallel --example stream [most threads] [MiB an array and thread]`; prints
//! `threads,gb_per_s`. 24 bytes an entry are counted, as STREAM does: not what a store reads of its cache line first.
//! Each thread fills the arrays it works on, so the pages are near it, as they are for ranks.

use std::error::Error;
use std::sync::Barrier;
use std::time::Instant;

const REPETITIONS: usize = 12;

fn triad(a: &mut [f64], b: &[f64], c: &[f64], s: f64) {
    for ((a, b), c) in a.iter_mut().zip(b).zip(c) {
        *a = b + s * c;
    }
}

/// GB/s of so many threads together, each on three arrays of `length` entries.
fn bandwidth(threads: usize, length: usize) -> f64 {
    let barrier = Barrier::new(threads);
    let work = |number: usize| {
        let (mut a, b, c) = (vec![0.0; length], vec![1.0; length], vec![2.0; length]);
        let mut times = [0.0; REPETITIONS];
        for (k, time) in times.iter_mut().enumerate() {
            barrier.wait();
            let start = Instant::now();
            triad(&mut a, &b, &c, (number + k) as f64);
            *time = start.elapsed().as_secs_f64();
        }
        assert!(
            a.iter()
                .all(|x| *x == 1.0 + 2.0 * (number + REPETITIONS - 1) as f64)
        );
        times
    };
    let times: Vec<_> = std::thread::scope(|scope| {
        let handles: Vec<_> = (0..threads).map(|k| scope.spawn(move || work(k))).collect();
        handles.into_iter().filter_map(|h| h.join().ok()).collect()
    });
    // The first repetition touches the pages of `a`.
    let slowest = |k: usize| times.iter().map(|t| t[k]).fold(0.0, f64::max);
    let best = (1..REPETITIONS).map(slowest).fold(f64::INFINITY, f64::min);
    (24 * length * threads) as f64 / best * 1e-9
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut arguments = std::env::args().skip(1);
    let all = std::thread::available_parallelism()?.get();
    let most: usize = arguments.next().map_or(Ok(all), |text| text.parse())?;
    let mebibytes: usize = arguments.next().map_or(Ok(128), |text| text.parse())?;
    println!("threads,gb_per_s");
    for threads in 1..=most {
        println!("{threads},{:.1}", bandwidth(threads, mebibytes << 17));
    }
    Ok(())
}
