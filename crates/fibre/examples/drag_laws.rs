//! Laws as numbers, for figures: `cargo run --release -p fibreflow-fibre --example drag_laws`.
//!
//! Writes CSV: Reynolds number of the normal slip, C_n and C_l of the infinite cylinder, of slender bodies of aspect ratio
//! 20 and 200 and of `auto` with them, and the logarithmic slopes d ln f/d ln Re of normal and axial force with their analytic derivatives.

use fibreflow_fibre::Vector3;
use fibreflow_fibre::hydrodynamics::{DragModel, FluidProperties, Section, SlenderConstants};

fn main() {
    let fluid = FluidProperties {
        density: 1.0,
        viscosity: 1.0,
    };
    let t = Vector3::x();
    let models = [
        ("cylinder", DragModel::InfiniteCylinder, 20.0),
        (
            "slender20",
            DragModel::SlenderBody(SlenderConstants::Batchelor),
            20.0,
        ),
        (
            "slender200",
            DragModel::SlenderBody(SlenderConstants::Batchelor),
            200.0,
        ),
        ("auto20", DragModel::Auto(SlenderConstants::Batchelor), 20.0),
        (
            "auto200",
            DragModel::Auto(SlenderConstants::Batchelor),
            200.0,
        ),
    ];
    let mut header = "re".to_owned();
    for (name, _, _) in &models {
        header += &format!(",cn_{name},cl_{name},slope_{name},axial_slope_{name}");
    }
    println!("{header}");
    for k in 0..=960 {
        let re = 10f64.powf(-4.0 + f64::from(k) / 120.0);
        let mut line = format!("{re:e}");
        for (_, model, ratio) in &models {
            // With d = ρ = μ = 1 a normal slip of Re; f = ½ Re C slip.
            let slip = Vector3::new(re, re, 0.0);
            let response = model.response(&t, &slip, &Section::middle(1.0, *ratio), &fluid);
            let [n, l] = [response.resistance.normal, response.resistance.axial];
            let slope = [
                response.by_slip[(1, 1)] / n,
                1.0 + response.by_slip[(0, 1)] / l,
            ];
            line += &format!(
                ",{:e},{:e},{:e},{:e}",
                2.0 * n / re,
                2.0 * l / re,
                slope[0],
                slope[1]
            );
        }
        println!("{line}");
    }
}
