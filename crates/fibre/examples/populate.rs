//! How dense random fibres get, and how long that takes: ten thousand in a box, a channel and a pipe.
//!
//! `cargo run --release -p fibreflow-fibre --example populate [FIBRES]`

use fibreflow_fibre::placement::{
    Amount, CentreLine, Orientation, PlacementGroup, Population, Quantity, Region, place,
};
use fibreflow_fibre::{PeriodicBox, Vector3};
use std::f64::consts::PI;
use std::time::Instant;

fn main() {
    let count = std::env::args().nth(1).and_then(|a| a.parse().ok());
    let count: f64 = count.unwrap_or(10_000.0);
    for (aspect_ratio, fraction) in [(20.0, 0.15), (75.0, 0.05), (20.0, 0.3)] {
        let fibre = 0.25 * PI / (aspect_ratio * aspect_ratio);
        let volume = count * fibre / fraction;
        let edge = volume.cbrt();
        let cube = Region::Box {
            origin: Vector3::zeros(),
            size: Vector3::repeat(edge),
        };
        let pipe = Region::Pipe {
            start: Vector3::zeros(),
            axis: 0,
            radius: (volume / (PI * edge)).sqrt(),
            length: edge,
        };
        for (name, region, walls) in [("box", cube, 0), ("channel", cube, 1), ("pipe", pipe, 2)] {
            let group = PlacementGroup {
                amount: Amount::VolumeFraction(fraction),
                length: Quantity::Constant(1.0),
                radius: 0.5 / aspect_ratio,
                centre_line: CentreLine::Straight,
                segments: 20,
                region,
                gap: 0.0,
                orientation: Orientation::Isotropic,
                seed: 1,
            };
            let population = Population {
                periodic: PeriodicBox {
                    origin: Vector3::zeros(),
                    lengths: [0, 1, 2].map(|axis| (axis < 3 - walls).then_some(edge)),
                },
                groups: vec![group],
                held: Vec::new(),
            };
            let start = Instant::now();
            match place(&population) {
                Ok(placed) => {
                    let placed = &placed[0];
                    println!(
                        "r = {aspect_ratio}, {name}, edge {edge:.2} lengths: {} of {} fibres, fraction {:.4}, ⟨pp⟩ within {:.4}, {} steps, {:.1} s",
                        placed.fibres.len(),
                        placed.wanted,
                        placed.volume_fraction[1],
                        placed.orientation_error,
                        placed.steps,
                        start.elapsed().as_secs_f64()
                    );
                }
                Err(error) => println!("{error}"),
            }
        }
    }
}
