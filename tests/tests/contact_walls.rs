//! Boundary patches of a mesh as walls of the fibres.

use fibreflow_tests::program::Bench;

/// Between a cylinder of radius 1 and one of radius 2 (48 facets round): one fibre falls onto the inner one and stays
/// draped over it, another one into the outer one.
fn case() -> String {
    let mesh = concat!(
        env!("CARGO_MANIFEST_DIR"),
        "/../cases/taylor-couette/ring.msh"
    );
    format!(
        r#"[time]
end = 1.6
step = 0.004

[mesh]
kind = "gmsh"
file = "{mesh}"

[fluid]
density = 1.0
viscosity = 0.5

[fluid.boundaries]
inner = {{ kind = "wall" }}
outer = {{ kind = "wall" }}
z_min = {{ kind = "slip" }}
z_max = {{ kind = "slip" }}

[gravity]
acceleration = [0, -9.8, 0]

[[fibres]]
placement = {{ kind = "line", start = [-0.3, 1.2, 0.05], end = [0.35, 1.15, 0.05] }}
diameter = 0.03
segments = 8
youngs_modulus = 1e6
density = 100.0

[[fibres]]
placement = {{ kind = "line", start = [-0.2, -1.8, 0.05], end = [0.15, -1.75, 0.05] }}
diameter = 0.03
segments = 8
youngs_modulus = 1e6
density = 100.0

[contact]
stiffness = 1000
damping = 0.5
friction = 0.3
walls = [{{ kind = "patches", names = ["inner", "outer"] }}]
lubrication = {{ roughness = 1e-3, range = 1e-2 }}

[output]
track = [0, 1]
"#
    )
}

fn last(bench: &Bench, out: &str, series: &str, column: &str) -> f64 {
    let path = bench.path(out).join("series").join(series);
    let text = std::fs::read_to_string(path).expect("series");
    let mut lines = text.lines();
    let names = lines.next().expect("header").split(',');
    let index = names.clone().position(|n| n == column).expect("a column");
    let line = lines.next_back().expect("a line");
    let value = line.split(',').nth(index).expect("a value");
    value.parse().expect("a number")
}

#[test]
fn fibres_come_to_rest_on_the_patches_of_a_mesh() {
    let bench = Bench::new(env!("CARGO_BIN_EXE_program"), &case());
    for ranks in [1, 2] {
        let out = format!("out{ranks}");
        let Some(ended) = bench.run(ranks, &out, &[]) else {
            return;
        };
        assert!(ended.status.success(), "{}", ended.text);
        let value = |series: &str, column: &str| last(&bench, &out, series, column);
        assert!(value("fibres.csv", "kinetic_energy") < 1e-7);
        assert!(value("fibres.csv", "wall_contacts") >= 4.0);
        // A straight fibre of this weight would touch at its middle alone; its ends hang down.
        let (middle, end) = (
            value("fibre_0.csv", "centre_y"),
            value("fibre_0.csv", "end_y"),
        );
        assert!(middle > 0.99 && middle < 1.02, "{middle}");
        assert!(end < middle - 0.02, "{end}");
        // The other one lies as a chord: its end on a circle of the pipe's radius less its own.
        let [x, y] = ["end_x", "end_y"].map(|c| value("fibre_1.csv", c));
        assert!((x.hypot(y) - 1.985).abs() < 0.006, "{x} {y}");
    }
}
