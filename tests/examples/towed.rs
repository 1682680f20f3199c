//! Drag on a towed segment against the law, over random positions, directions, meshes and Reynolds numbers.
//!
//!     cargo run --release -p fibreflow-tests --example towed [COUNT [bulk|wall [RE]]] > towed.csv
//!
//! One line a tow: kernel, correction, walls, elements, cells, Re, largest error, excess of drag at the end, images.

use fibreflow_coupling::Kernel;
use fibreflow_mesh::BoxElement;
use fibreflow_tests::towed::{BOX, Basin, LENGTH, Tow};
use nalgebra::Vector3;
use rand::{Rng, SeedableRng};

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let mut arguments = std::env::args().skip(1);
    let count: usize = arguments.next().map_or(Ok(200), |n| n.parse())?;
    let only = arguments.next();
    let one: Option<f64> = arguments.next().map(|n| n.parse()).transpose()?;
    let mut rng = rand_chacha::ChaCha8Rng::seed_from_u64(5);
    println!("kernel,corrected,walls,element,cells,reynolds,error,excess,images");
    let mut unit = || loop {
        let x = Vector3::from_fn(|_, _| rng.random_range(-1.0..1.0_f64));
        if x.norm() > 0.1 && x.norm() < 1.0 {
            break (x.normalize(), x);
        }
    };
    let meshes = [
        (BoxElement::Hexahedron, 24),
        (BoxElement::Tetrahedron, 24),
        (BoxElement::Prism, 24),
        (BoxElement::Hexahedron, 36),
        (BoxElement::Tetrahedron, 36),
        (BoxElement::Prism, 36),
    ];
    let numbers = [1e-3, 0.1, 1.0, 10.0];
    let mut groups = Vec::new();
    for (name, walls) in [("bulk", false), ("wall", true)] {
        if only.as_ref().is_some_and(|only| only != name) {
            continue;
        }
        for (element, cells) in meshes {
            // The finer meshes take most of the time, and fewer tows.
            for reynolds in numbers
                .into_iter()
                .filter(|&n| one.is_none_or(|one| one == n))
            {
                if walls && cells > 24 {
                    continue;
                }
                groups.push((walls, element, cells, reynolds));
            }
        }
    }
    let share = count.div_ceil(groups.len());
    for (walls, element, cells, reynolds) in groups {
        let mut tow = Tow {
            element,
            cells,
            reynolds,
            walls,
            kernel: Kernel::Gaussian { width: 1.0 },
            corrected: true,
            middle: Vector3::zeros(),
            directions: [Vector3::x(), Vector3::y()],
        };
        let mut basin = Basin::new(&tow)?;
        for k in 0..share {
            tow.directions = [unit().0, unit().0];
            tow.middle = Vector3::repeat(0.5 * BOX) + 0.5 * BOX * unit().1;
            if walls {
                // One length from the wall, and along it where the segment moves on.
                tow.middle.y = LENGTH;
                if reynolds > 0.02 {
                    tow.directions[1].y = 0.0;
                    tow.directions[1] = tow.directions[1].normalize();
                }
            }
            // Every tow with the correction, one in three without and by elements too.
            let both = [
                (Kernel::Gaussian { width: 1.0 }, true),
                (Kernel::Gaussian { width: 1.0 }, false),
                (Kernel::Element, false),
            ];
            for (kernel, corrected) in both.into_iter().take(if k % 3 == 0 { 3 } else { 1 }) {
                let towed = basin.tow(&Tow {
                    kernel,
                    corrected,
                    ..tow
                })?;
                let name = if kernel == Kernel::Element {
                    "element"
                } else {
                    "gaussian"
                };
                println!(
                    "{name},{corrected},{walls},{element:?},{cells},{reynolds:e},{:.5},{:.5},{:.5}",
                    towed.error, towed.excess, towed.images
                );
            }
        }
    }
    Ok(())
}
