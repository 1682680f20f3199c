//! Linked fibres in a fluid that is solved for, from a case file.

use fibreflow_tests::program::Bench;

const CHANNEL: &str = include_str!("../../cases/linked-channel/case.toml");

#[test]
fn a_channel_with_linked_fibres_goes_on_where_it_stopped() {
    let case = CHANNEL.replacen("count = 300", "count = 40", 1);
    let bench = Bench::new(env!("CARGO_BIN_EXE_program"), &case);
    let less = [
        "--set",
        "mesh.cells=[12, 12, 6]",
        "--set",
        "time.end=8e-3",
        "--set",
        "time.max_step=1e-3",
    ];
    let run = |out: &str, more: &[&str]| {
        let arguments = [&less[..], more].concat();
        let ended = bench.run(1, out, &arguments).expect("one rank");
        assert!(ended.status.success(), "{}", ended.text);
    };
    run("whole", &[]);
    run("parts", &["--steps", "3"]);
    run("parts", &["--resume"]);
    let last_line = |out: &str, series: &str| {
        let path = bench.path(out).join("series").join(series);
        let text = std::fs::read_to_string(path).expect("a series");
        text.lines().last().expect("lines").to_owned()
    };
    for series in ["fibres.csv", "fluid.csv"] {
        assert_eq!(last_line("whole", series), last_line("parts", series));
    }
}

#[test]
fn what_linked_fibres_in_a_fluid_cannot_do_is_refused() {
    let changes = [
        (
            "[contact]",
            "[mechanics]\nintegrator = \"explicit\"\n\n[contact]",
            "mechanics.integrator",
        ),
        (
            "[contact]",
            "[coupling]\nkernel = \"gaussian\"\nwidth = 2e-3\ncorrection = \"undisturbed\"\n\n[contact]",
            "coupling.correction",
        ),
        (
            "[contact]",
            "[coupling]\nkernel = \"middle\"\n\n[contact]",
            "coupling.kernel",
        ),
        (
            "observables = { every = 1 }",
            "observables = { every = 1, stress = true }",
            "output.observables.stress",
        ),
        (
            "viscosity = 0.01    # Pa·s",
            "viscosity = 0.01\ninertia = \"linear\"",
            "fluid.inertia",
        ),
    ];
    for (old, new, wanted) in changes {
        let case = CHANNEL.replacen(old, new, 1);
        assert_ne!(case, CHANNEL);
        let bench = Bench::new(env!("CARGO_BIN_EXE_program"), &case);
        let ended = bench.run(1, "out", &["--steps", "1"]).expect("one rank");
        assert_eq!(ended.status.code(), Some(2), "{wanted}: {}", ended.text);
        assert!(ended.text.contains(wanted), "{wanted}: {}", ended.text);
    }
}
