//! Linked fibres from a case file: the star floc runs and goes on bit by bit, and what does not fit is refused.

use fibreflow_tests::launch;
use fibreflow_tests::program::{Bench, LIMIT};

const PROGRAM: &str = env!("CARGO_BIN_EXE_program");
const CASE: &str = include_str!("../../cases/star-floc/case.toml");
const NETWORK: &str = include_str!("../../cases/planar-network/case.toml");
const PULL: &str = include_str!("../../cases/planar-network/pull.toml");

fn bench(case: &str) -> Bench {
    let bench = Bench::new(PROGRAM, case);
    let star = include_str!("../../cases/star-floc/star.csv");
    std::fs::write(bench.path("star.csv"), star).expect("written");
    bench
}

fn last_line(bench: &Bench, out: &str, series: &str) -> String {
    let path = bench.path(out).join("series").join(series);
    let text = std::fs::read_to_string(path).expect("a series");
    text.lines().last().expect("lines").to_owned()
}

#[test]
fn a_run_goes_on_where_it_stopped() {
    let bench = bench(CASE);
    let long = ["--set", "time.end=2e-3"];
    let run = |out: &str, more: &[&str]| {
        let arguments = [&long[..], more].concat();
        let ended = bench.run(1, out, &arguments).expect("one rank");
        assert!(ended.status.success(), "{}", ended.text);
    };
    run("whole", &[]);
    run("parts", &["--steps", "7"]);
    run("parts", &["--resume"]);
    let line = last_line(&bench, "whole", "fibres.csv");
    assert_eq!(line, last_line(&bench, "parts", "fibres.csv"));
    assert!(line.starts_with("20,"), "{line}");
    assert_eq!(bench.summary("whole")["fibres"]["segments"], 35);
}

fn numbers(line: &str) -> Vec<f64> {
    let number = |text: &str| text.parse().expect("a number");
    line.split(',').map(number).collect()
}

/// The piston stops where the fibres take the volume fraction that is asked for; the network goes on to another case, whose grips pull it.
#[test]
fn a_network_is_formed_and_pulled() {
    let former = Bench::new(PROGRAM, NETWORK);
    let few = [
        "--set=fibres.0.placement.count=40",
        "--set=ambient.domain.size=[3e-3, 3e-3, 4e-4]",
        "--set=piston.volume_fraction=5.4e-3",
        "--set=time.step=0.02",
        "--set=time.end=4.0",
    ];
    let run = |out: &str, more: &[&str]| {
        let ended = former.run(1, out, &[&few[..], more].concat());
        let ended = ended.expect("one rank");
        assert!(ended.status.success(), "{}", ended.text);
    };
    run("whole", &[]);
    run("parts", &["--steps", "70"]);
    run("parts", &["--resume"]);
    for series in ["piston.csv", "fibres.csv"] {
        let [whole, parts] = ["whole", "parts"].map(|out| last_line(&former, out, series));
        assert_eq!(whole, parts);
    }
    let [.., travelled, speed, _] = numbers(&last_line(&former, "whole", "piston.csv"))[..] else {
        panic!("columns");
    };
    let volume = 40.0 * std::f64::consts::PI * 1e-10 * 1.5e-3;
    let height = 4e-4 - travelled;
    let fraction = volume / (9e-6 * height);
    assert!((fraction / 5.4e-3 - 1.0).abs() < 1e-12 && speed == 0.0);

    let puller = Bench::new(PROGRAM, PULL);
    let mut post = launch::command(PROGRAM, 1);
    post.args(["post", "extract-fibres"]);
    post.arg(former.path("whole"))
        .arg(puller.path("network.csv"));
    let ended = launch::run(post, LIMIT).expect("one rank");
    assert!(ended.status.success(), "{}", ended.text);
    let walls = PULL.replace("2.0943951023931953e-4", &format!("{height:e}"));
    assert_ne!(walls, PULL);
    std::fs::write(puller.path("case.toml"), walls).expect("written");
    let ended = puller.run(1, "out", &["--set=time.end=0.5"]);
    let ended = ended.expect("one rank");
    assert!(ended.status.success(), "{}", ended.text);
    let last = numbers(&last_line(&puller, "out", "grips.csv"));
    let [step, _, elongation, tension, lower, upper, gripped] = last[..] else {
        panic!("columns");
    };
    assert_eq!(step, 50.0);
    assert!(
        (elongation - 1e-5).abs() < 1e-12 && gripped >= 2.0,
        "{last:?}"
    );
    assert!(lower < 0.0 && upper > 0.0 && (upper - lower - 2.0 * tension).abs() < 1e-12 * upper);
}

#[test]
fn what_does_not_fit_is_refused() {
    let changes = [
        (
            "friction = 20.0",
            "friction = 20.0\nstiffness = 1.0",
            "contact.stiffness",
        ),
        ("torque = \"prolate-spheroid\"", "", "hydrodynamics.torque"),
        (
            "density = 1000.0\n\n[contact]",
            "density = 1000.0\nclamp = \"first\"\n\n[contact]",
            "fibres[0].clamp",
        ),
        ("length = 1.12e-3\n", "", "fibres[0]` lacks `length`"),
        ("kinematics = \"linked\"", "", "`contact` lacks `stiffness`"),
        (
            "[contact]",
            "[contact]\nwalls = [{ kind = \"pipe\", point = [0, 0, 0], axis = [1, 0, 0], radius = 1.0 }]",
            "contact.walls[0].kind",
        ),
        (
            "[contact]",
            "[grips]\naxis = \"x\"\nplanes = [1.0, 0.0]\nspeed = 1.0\n\n[contact]",
            "grips.planes",
        ),
        (
            "[contact]",
            "[piston]\nface = \"z_max\"\nmass = 1.0\nweight = 1.0\nvolume_fraction = 0.1\n\n[contact]",
            "piston.face",
        ),
        (
            "star.csv",
            "comet.csv",
            "fibres[0].placement.file = \"comet.csv\"",
        ),
    ];
    for (old, new, wanted) in changes {
        assert!(CASE.contains(old), "{old}");
        let bench = bench(&CASE.replace(old, new));
        let ended = bench.run(1, "out", &[]).expect("one rank");
        assert_eq!(ended.status.code(), Some(2), "{old}: {}", ended.text);
        assert!(ended.text.contains(wanted), "no {wanted} in {}", ended.text);
    }
}
