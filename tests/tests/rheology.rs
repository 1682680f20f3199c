//! Stress of suspensions and dimensionless groups, as the program reports them.

use fibreflow_tests::launch;
use fibreflow_tests::program::{Bench, LIMIT};

/// A fibre that is held, of one segment, and one next to the upper wall.
const HELD: &str = r#"[time]
end = 1e-3
step = 1e-4

[ambient]
density = 1.0
viscosity = 2.0
flow = { kind = "shear", rate = 3.0 }
domain = { size = [4.0, 5.0, 2.0], periodic = [true, false, true] }

[[fibres]]
placement = { kind = "line", start = [1.0, 1.0, 1.0], end = [1.6, 1.8, 1.0] }
diameter = 0.02
segments = 1
youngs_modulus = 1e3
density = 1.0
clamp = "both"

[[fibres]]
placement = { kind = "line", start = [1.0, 4.55, 1.0], end = [2.0, 4.9, 1.0] }
diameter = 0.02
segments = 1
youngs_modulus = 1e3
density = 1.0
clamp = "both"

[hydrodynamics]
drag = "slender-body"
torque = "none"

[output.observables]
every = 5
stress = true
wall_margin = 0.5
"#;

/// Free fibres between walls in creeping flow, two-way.
const SHEARED: &str = r#"[time]
end = 1.0
step = 2e-3

[mesh]
kind = "box"
size = [2.0, 2.0, 2.0]
cells = [8, 8, 8]
periodic = [true, false, true]

[fluid]
density = 1e-3
viscosity = 3.0
inertia = "steady"
poisson = { tolerance = 1e-10 }
initial = { kind = "expression", velocity = ["y - 1", "0", "0"] }

[fluid.boundaries]
y_min = { kind = "moving-wall", velocity = [-1.0, 0.0, 0.0] }
y_max = { kind = "moving-wall", velocity = [1.0, 0.0, 0.0] }

[[fibres]]
placement = { kind = "random", count = 8, seed = 3 }
length = 0.8
diameter = 0.04
segments = 4
kinematics = "rigid"
youngs_modulus = 1e9
density = 1e-3

[hydrodynamics]
drag = "slender-body"

[output.observables]
every = 5
stress = true
"#;

/// A column of a series, by its name.
fn column(bench: &Bench, out: &str, file: &str, name: &str) -> Vec<f64> {
    let path = bench.path(out).join("series").join(file);
    let text = std::fs::read_to_string(path).expect("series");
    let mut lines = text.lines();
    let names: Vec<&str> = lines.next().expect("header").split(',').collect();
    let index = names.iter().position(|n| *n == name);
    let index = index.unwrap_or_else(|| panic!("no `{name}` in {names:?}"));
    let value = |line: &str| line.split(',').nth(index).expect("whole").parse();
    lines.map(|line| value(line).expect("number")).collect()
}

fn last(bench: &Bench, out: &str, name: &str) -> f64 {
    *column(bench, out, "stress.csv", name).last().expect("line")
}

fn run(bench: &Bench, ranks: usize, out: &str, arguments: &[&str]) -> bool {
    let Some(ended) = bench.run(ranks, out, arguments) else {
        return false;
    };
    assert!(ended.status.success(), "{}", ended.text);
    true
}

/// S = (L³/12) sym(p Z G p) less its trace over the box without its margin; ζ of Batchelor, r_p = 50. The fibre at the wall,
/// which has another direction, is not in it.
#[test]
fn a_held_fibre_has_the_stress_of_a_slender_body() {
    let bench = Bench::new(env!("CARGO_BIN_EXE_program"), HELD);
    run(&bench, 1, "out", &[]);
    let (p, rate, viscosity) = ([0.6, 0.8], 3.0, 2.0);
    let ln = 100.0_f64.ln() + std::f64::consts::LN_2;
    let across = 4.0 * std::f64::consts::PI * viscosity / (ln - 0.5);
    let along = 2.0 * std::f64::consts::PI * viscosity / (ln - 1.5);
    // Slip by length from the middle (γ̇ p_y, 0): along p γ̇ p_x p_y, the rest across.
    let parallel = rate * p[0] * p[1];
    let force = [
        across * (rate * p[1] - parallel * p[0]) + along * parallel * p[0],
        across * (-parallel * p[1]) + along * parallel * p[1],
    ];
    let volume = 4.0 * (5.0 - 2.0 * 0.5) * 2.0;
    let shear = 0.5 * (p[0] * force[1] + p[1] * force[0]) / 12.0 / volume;
    let found = last(&bench, "out", "particle_xy");
    assert!((found / shear - 1.0).abs() < 1e-9, "{found} {shear}");
    let first = (p[0] * force[0] - p[1] * force[1]) / 12.0 / volume;
    let found = last(&bench, "out", "n1");
    assert!((found / first - 1.0).abs() < 1e-9, "{found} {first}");
    let found = last(&bench, "out", "mu_rel");
    let expected = 1.0 + shear / (viscosity * rate);
    assert!((found - expected).abs() < 1e-12, "{found} {expected}");
    let moment = column(&bench, "out", "orientation.csv", "a_xxyy");
    assert!((moment[0] - (0.6 * 0.8_f64).powi(2)).abs() < 1e-12);
}

/// What the walls feel is the fluid's own stress and that of the fibres: K 6.15 and the first moment of the forces.
#[test]
fn walls_feel_the_stress_of_free_fibres() {
    let bench = Bench::new(env!("CARGO_BIN_EXE_program"), SHEARED);
    run(&bench, 1, "out", &["--steps", "20"]);
    let of = |name: &str| column(&bench, "out", "stress.csv", name);
    let (volume, walls) = (of("mu_rel"), of("mu_rel_wall"));
    for (volume, wall) in volume.iter().zip(&walls).skip(1) {
        assert!(*volume > 1.005);
        assert!(
            (volume - wall).abs() < 1e-3 * (wall - 1.0),
            "{volume} {wall}"
        );
    }
    let fluid = last(&bench, "out", "fluid_xy");
    assert!((fluid - 3.0).abs() < 1e-9, "{fluid}");
    // With a margin the walls still feel all fibres.
    let margin = [
        "--steps",
        "10",
        "--set",
        "output.observables.wall_margin=0.4",
    ];
    run(&bench, 1, "margin", &margin);
    let [middle, whole] = ["mu_rel", "mu_rel_whole"].map(|c| last(&bench, "margin", c));
    assert!((whole - volume[2]).abs() < 1e-12, "{whole} {volume:?}");
    assert!((middle - whole).abs() > 1e-4, "{middle} {whole}");
}

/// Two fibres pressed together: what their contact adds is in `contact_*`, and the walls feel it too.
#[test]
fn walls_feel_contacts() {
    let bench = Bench::new(env!("CARGO_BIN_EXE_program"), &crossed());
    // Contacts are those at the end of a step, the rest is the mean over it, and the overlap goes within some 0.02 s.
    let short = ["--steps", "10", "--set", "time.step=1e-4"];
    run(&bench, 1, "out", &short);
    let contact = last(&bench, "out", "contact_xy");
    let particle = last(&bench, "out", "particle_xy");
    let sum = last(&bench, "out", "mu_rel");
    let expected = 1.0 + (contact + particle) / 3.0;
    assert!((sum - expected).abs() < 1e-9, "{sum} {expected}");
    assert!(contact.abs() > 1e-3 * 3.0, "{contact}");
    let wall = last(&bench, "out", "mu_rel_wall");
    println!("{contact} {particle} {sum} {wall}");
    // The contact acts across the thickness too, which is no part of `contact`: d/L of it.
    assert!(
        (sum - wall).abs() < 0.06 * contact.abs() / 3.0,
        "{sum} {wall}"
    );
}

/// Two crossed rods that overlap far from the middle of both, one above the other.
fn crossed() -> String {
    let rods = [
        ([0.8, 0.985, 1.0], [1.6, 0.985, 1.0]),
        ([0.476, 1.015, 0.576], [1.041, 1.015, 1.141]),
    ];
    let rods = rods.map(|(start, end)| {
        format!(
            "[[fibres]]\nplacement = {{ kind = \"line\", start = {start:?}, end = {end:?} }}\n\
             diameter = 0.04\nsegments = 4\nkinematics = \"rigid\"\nyoungs_modulus = 1e9\ndensity = 1e-3\n"
        )
    });
    let (head, tail) = SHEARED.split_once("[[fibres]]").expect("fibres");
    let (_, tail) = tail.split_once("[hydro").expect("laws");
    format!(
        "{head}{}[contact]\nstiffness = 100.0\n\n[hydro{tail}",
        rods.join("\n")
    )
}

#[test]
fn stress_goes_on_after_a_restart_and_is_that_of_other_ranks() {
    let bench = Bench::new(env!("CARGO_BIN_EXE_program"), SHEARED);
    run(&bench, 1, "whole", &["--steps", "20"]);
    run(&bench, 1, "parts", &["--steps", "10"]);
    run(&bench, 1, "parts", &["--steps", "20", "--resume"]);
    let text = |out: &str| std::fs::read_to_string(bench.path(out).join("series/stress.csv"));
    assert_eq!(
        text("whole").expect("series"),
        text("parts").expect("series")
    );
    if !run(&bench, 2, "two", &["--steps", "20"]) {
        return;
    }
    for name in [
        "fluid_xy",
        "particle_xy",
        "particle_xx",
        "n2",
        "mu_rel",
        "mu_rel_wall",
    ] {
        let [one, two] = ["whole", "two"].map(|out| last(&bench, out, name));
        assert!((one - two).abs() < 1e-6 * one.abs(), "{name}: {one} {two}");
    }
}

/// Text of `check` for a case.
fn check(case: &str) -> String {
    let bench = Bench::new(env!("CARGO_BIN_EXE_program"), case);
    let mut command = launch::command(env!("CARGO_BIN_EXE_program"), 1);
    command.arg("check").arg(bench.path("case.toml"));
    let ended = launch::run(command, LIMIT).expect("one rank");
    assert!(ended.status.success(), "{}", ended.text);
    ended.text
}

#[test]
fn check_prints_groups_and_is_content_inside_the_range_of_models() {
    let text = check(SHEARED);
    // ρUH/μ = 1e-3 · 1 · 2 / 3; nL³ = 8 · 0.8³/8; a segment of 0.2 m by (8/(8·9·8))^(1/3).
    for part in [
        "Re = ρUH/μ = 0.001",
        "γ̇ = 1.000e0 1/s",
        "r_p = 20.0",
        "nL³ = 0.512",
        "segment by element 0.83",
        "viscous H²/ν = 1.333e-3 s, convective H/U = 2.000e0 s",
    ] {
        assert!(text.contains(part), "{part} is not in\n{text}");
    }
    assert!(!text.contains("warning"), "{text}");
    // ρUd/μ = 1 · 3 · 0.02/2 past a clamp, in a uniform stream: ζ⊥ (2U/L) L⁴/EI, with EI = 1e3 π 0.02⁴/64.
    let stream = HELD.replace(
        "kind = \"shear\", rate = 3.0",
        "kind = \"uniform\", velocity = [3.0, 0, 0]",
    );
    let stream = stream.replace("drag = \"slender-body\"", "drag = \"auto\"");
    let text = check(&stream);
    for part in [
        "r_p = 50.0",
        "Re_d = 3.000e-2 (U past the clamp)",
        "ζ⊥γ̇L⁴/EI = 4.001e6",
    ] {
        assert!(text.contains(part), "{part} is not in\n{text}");
    }
}

#[test]
fn check_warns_of_models_outside_their_range() {
    let wrong = SHEARED
        .replace("diameter = 0.04", "diameter = 0.1")
        .replace("segments = 4", "segments = 1")
        .replace("count = 8", "count = 30")
        .replace("step = 2e-3", "step = 0.25")
        .replace("density = 1e-3\nviscosity", "density = 30.0\nviscosity")
        .replace("cells = [8, 8, 8]", "cells = [16, 16, 16]")
        .replace(
            "[hydrodynamics]",
            "[contact]\nstiffness = 1.0\n\n[hydrodynamics]",
        );
    let text = check(&wrong);
    for part in [
        "convection is left out at Re = 20.0",
        "a strain of γ̇Δt = 0.25",
        "slender-body drag holds below Re_d = 0.01",
        "slender-body drag holds above r_p = 10, here 8.0",
        "two-way coupling wants segments of 0.5 to 4 elements",
        "contacts are soft",
    ] {
        assert!(text.contains(part), "{part} is not in\n{text}");
    }
    let cylinder = check(&SHEARED.replace("\"slender-body\"", "\"infinite-cylinder\""));
    assert!(
        cylinder.contains("that of infinite cylinders does not"),
        "{cylinder}"
    );
    let alone = format!(
        "{}\n[coupling]\nmode = \"one-way\"\n",
        SHEARED.replace("count = 8", "count = 30")
    );
    let alone = check(&alone);
    assert!(alone.contains("one-way coupling leaves out"), "{alone}");
}
