//! Wrong input gives one paragraph that names the place, and exit code 2.

use fibreflow_tests::program::Bench;

const CASE: &str = r#"[time]
end = 0.2
step = 0.1

[mesh]
kind = "box"
size = [1.0, 1.0, 1.0]
cells = [4, 4, 4]
periodic = [true, false, true]

[fluid]
density = 1000.0
viscosity = 0.1

[fluid.boundaries]
y_min = { kind = "wall" }
y_max = { kind = "wall" }

[[fibres]]
placement = { kind = "line", start = [0.4, 0.5, 0.5], end = [0.6, 0.5, 0.5] }
diameter = 0.01
segments = 4
youngs_modulus = 1e6
density = 1000.0
"#;

fn bench(case: &str) -> Bench {
    Bench::new(env!("CARGO_BIN_EXE_program"), case)
}

/// Runs the case and checks that the message names all of `wanted`.
fn refused(bench: &Bench, arguments: &[&str], wanted: &[&str]) {
    let ended = bench
        .run(1, "out", arguments)
        .expect("one rank needs no mpirun");
    assert_eq!(ended.status.code(), Some(2), "{}", ended.text);
    for part in wanted {
        assert!(ended.text.contains(part), "no `{part}` in:\n{}", ended.text);
    }
}

/// With `old` replaced by `new`, which must be there.
fn changed(old: &str, new: &str) -> Bench {
    assert!(CASE.contains(old));
    bench(&CASE.replace(old, new))
}

#[test]
fn the_case_as_it_is_runs() {
    let ended = bench(CASE)
        .run(1, "out", &[])
        .expect("one rank needs no mpirun");
    assert!(ended.status.success(), "{}", ended.text);
}

#[test]
fn an_unknown_key() {
    let bench = changed("viscosity = 0.1", "viscosity = 0.1\nviscocity = 0.2");
    refused(
        &bench,
        &[],
        &[
            "fluid.viscocity",
            "case.toml:14",
            "did you mean `viscosity`",
        ],
    );
}

#[test]
fn a_wrong_type() {
    let bench = changed("end = 0.2", "end = \"soon\"");
    refused(
        &bench,
        &[],
        &["time.end = \"soon\"", "case.toml:2", "number"],
    );
}

#[test]
fn text_that_is_not_toml() {
    let bench = changed("step = 0.1", "step = = 0.1");
    refused(&bench, &[], &["case.toml:3"]);
}

#[test]
fn a_negative_viscosity() {
    let bench = changed("viscosity = 0.1", "viscosity = -0.1");
    refused(
        &bench,
        &[],
        &["fluid.viscosity = -0.1", "case.toml:13", "greater than 0"],
    );
    refused(
        &self::bench(CASE),
        &["--set", "fluid.viscosity=-2"],
        &["--set fluid.viscosity=-2"],
    );
}

#[test]
fn an_order_that_is_not_there() {
    let bench = changed("viscosity = 0.1", "viscosity = 0.1\norder = 3");
    refused(
        &bench,
        &[],
        &["fluid.order = 3", "case.toml:14", "valid: 2, 4"],
    );
}

#[test]
fn fourth_order_on_tetrahedra() {
    let bench = changed(
        "kind = \"box\"",
        "kind = \"box\"\nelement = \"tetrahedron\"",
    );
    refused(
        &bench,
        &["--set", "fluid.order=4"],
        &["fluid.order = 4", "axis-parallel hexahedra"],
    );
}

#[test]
fn direct_solves_on_a_jittered_mesh() {
    let bench = changed("kind = \"box\"", "kind = \"box\"\njitter = 0.1");
    refused(
        &bench,
        &["--set", "fluid.poisson.preconditioner=direct"],
        &["fluid.poisson.preconditioner", "tensor product"],
    );
}

#[test]
fn a_missing_patch() {
    let bench = changed("y_max = { kind = \"wall\" }\n", "");
    refused(&bench, &[], &["lacks the patch `y_max`", "case.toml:15"]);
}

#[test]
fn a_patch_that_is_not_there() {
    let bench = changed("y_max = { kind", "y_mix = { kind");
    refused(
        &bench,
        &[],
        &["no patch `y_mix`", "did you mean `y_max`", "case.toml:17"],
    );
}

/// With another condition on y_max.
fn on_top(condition: &str) -> Bench {
    changed(
        "y_max = { kind = \"wall\" }",
        &format!("y_max = {condition}"),
    )
}

#[test]
fn keys_that_do_not_go_with_the_inertia() {
    let bench = bench(CASE);
    let set = |keys: &[&str], wanted: &[&str]| {
        let arguments: Vec<&str> = keys.iter().flat_map(|k| ["--set", k]).collect();
        refused(&bench, &arguments, wanted);
    };
    let held = "fluid.hold_mean_velocity=true";
    set(
        &[held],
        &[
            "`fluid.hold_mean_velocity` needs",
            "inertia full: nothing moves",
        ],
    );
    let (linear, steady) = ("fluid.inertia=linear", "fluid.inertia=steady");
    set(
        &[linear, "fluid.diffusion=explicit"],
        &["`fluid.diffusion` needs", "inertia linear"],
    );
    set(
        &[steady, "fluid.order=4"],
        &["`fluid.order` must be 2", "as set"],
    );
    let outlet = "fluid.boundaries.y_max={ kind = \"convective-outlet\" }";
    set(
        &[steady, outlet],
        &["`fluid.boundaries.y_max` is an outlet", "`outlet`"],
    );
    set(
        &["fluid.inertia=stokes"],
        &["fluid.inertia", "`linear`, `steady`"],
    );
}

/// Fibres would stay behind, creeping flow has nothing to carry, walls do not move along.
#[test]
fn a_mesh_that_cannot_move() {
    let frame = ["--set", "fluid.frame_velocity=[1, 0, 0]"];
    refused(&bench(CASE), &frame, &["fluid.frame_velocity", "fibres"]);
    let start = CASE.find("[[fibres]]").expect("fibres");
    let alone = bench(&CASE[..start]);
    let creeping = [&frame[..], &["--set", "fluid.inertia=steady"]].concat();
    refused(&alone, &creeping, &["`fluid.frame_velocity` needs"]);
    let across = ["--set", "fluid.frame_velocity=[0, 1, 0]"];
    refused(&alone, &across, &["frame", "y_m"]);
}

#[test]
fn a_force_that_no_node_feels() {
    let force = "fluid.forces=[{ position = [0.5, 3.0, 0.5], force = [1, 0, 0], width = 0.1 }]";
    let wanted = [
        "`fluid.forces[0].position = [0.5, 3.0, 0.5]`",
        "no node feels it",
    ];
    refused(&bench(CASE), &["--set", force], &wanted);
}

#[test]
fn a_step_that_explicit_diffusion_cannot_bear() {
    let viscous = [
        "--set",
        "fluid.viscosity=1e4",
        "--set",
        "fluid.diffusion=explicit",
    ];
    let wanted = [
        "`time.step = 0.1` is beyond the limit",
        "case.toml:3",
        "`time.cfl`",
    ];
    refused(&bench(CASE), &viscous, &wanted);
}

#[test]
fn loads_on_a_patch_that_is_not_there() {
    let loads = "[output.loads]\npatches = [\"y_min\", \"y_mix\"]\n\n[[fibres]]";
    let bench = changed("[[fibres]]", loads);
    let wanted = [
        "output.loads.patches[1]",
        "no patch `y_mix`",
        "did you mean `y_max`",
        "case.toml:20",
    ];
    refused(&bench, &[], &wanted);
    let drag = "output.loads.coefficients={ velocity = 1, area = 1, drag = [0, 0, 0] }";
    refused(
        &self::bench(CASE),
        &["--set", drag],
        &["coefficients.drag` is zero"],
    );
    let both = "output.loads={ every = 2, interval = 0.1 }";
    refused(
        &self::bench(CASE),
        &["--set", both],
        &["`output.loads` has both"],
    );
}

#[test]
fn an_unknown_condition() {
    let bench = on_top("{ kind = \"convective-outlets\" }");
    let wanted = [
        "fluid.boundaries.y_max.kind",
        "`convective-outlet`",
        "case.toml:17",
    ];
    refused(&bench, &[], &wanted);
}

#[test]
fn a_key_of_another_condition() {
    let bench = on_top("{ kind = \"slip\", velocity = [1, 0, 0] }");
    refused(
        &bench,
        &[],
        &["fluid.boundaries.y_max.velocity", "case.toml:17"],
    );
}

#[test]
fn an_inlet_without_velocity_or_with_two() {
    let bench = on_top("{ kind = \"inlet\", profile = \"uniform\" }");
    let wanted = ["y_max` lacks the key `velocity`", "case.toml:17", "formula"];
    refused(&bench, &[], &wanted);
    let bench = on_top(
        "{ kind = \"inlet\", velocity = [0, -1, 0], profile = { formula = [\"0\", \"1\", \"0\"] } }",
    );
    refused(&bench, &[], &["y_max.velocity", "no meaning", "`factor`"]);
}

#[test]
fn a_parabola_without_walls() {
    let bench = on_top("{ kind = \"inlet\", velocity = [0, -1, 0], profile = \"parabolic\" }");
    refused(
        &bench,
        &[],
        &[
            "y_max.profile = \"parabolic\"",
            "two opposite walls",
            "case.toml:17",
        ],
    );
}

#[test]
fn a_wall_that_turns_about_nothing() {
    let bench = on_top("{ kind = \"rotating-wall\", axis = [0, 0, 0], rate = 1.0 }");
    refused(
        &bench,
        &[],
        &["y_max.axis` is zero", "case.toml:17", "[0, 0, 1]"],
    );
}

#[test]
fn a_table_in_time_that_goes_back() {
    let bench = on_top(
        "{ kind = \"moving-wall\", velocity = [1, 0, 0], factor = { kind = \"table\", times = [0, 2, 1], values = [0, 1, 2] } }",
    );
    refused(
        &bench,
        &[],
        &["y_max.factor", "entry 3", "later", "case.toml:17"],
    );
}

#[test]
fn a_formula_in_an_unknown_variable() {
    let bench = on_top(
        "{ kind = \"outlet\", pressure = 1.0, factor = { kind = \"formula\", value = \"cos(2*x)\" } }",
    );
    refused(
        &bench,
        &[],
        &[
            "y_max.factor.value",
            "unknown name `x`",
            "known: t, pi",
            "case.toml:17",
        ],
    );
}

#[test]
fn a_profile_or_signal_file_with_a_bad_line() {
    let bench = on_top("{ kind = \"inlet\", profile = { file = \"inlet.csv\" } }");
    let place = "fluid.boundaries.y_max.profile.file = \"inlet.csv\"";
    refused(&bench, &[], &[place, "No such file", "case.toml:17"]);
    std::fs::write(bench.path("inlet.csv"), "x,v\n0,-1\n1,one\n").expect("file");
    refused(&bench, &[], &[place, "line 3: `one`", "u,v,w [m/s]"]);
    let bench = on_top("{ kind = \"outlet\", factor = { kind = \"file\", file = \"pulse.csv\" } }");
    std::fs::write(bench.path("pulse.csv"), "t,value\n0,-1\n").expect("file");
    let place = "fluid.boundaries.y_max.factor.file = \"pulse.csv\"";
    refused(
        &bench,
        &[],
        &[place, "line 1: unknown column `t`", "time,value"],
    );
}

#[test]
fn an_inlet_that_nothing_balances() {
    let bench = on_top("{ kind = \"inlet\", velocity = [0, -1, 0] }");
    refused(&bench, &[], &["[fluid]", "no outlet balances it"]);
}

#[test]
fn a_fibre_outside_the_domain() {
    let bench = changed("end = [0.6, 0.5, 0.5]", "end = [0.6, 1.5, 0.5]");
    refused(
        &bench,
        &[],
        &[
            "fibres[0].placement.end",
            "outside the domain: y = 1.5",
            "case.toml:20",
        ],
    );
}

/// Two tetrahedra that share a face; the second has two vertices swapped.
const INVERTED: &str = r#"$MeshFormat
4.1 0 8
$EndMeshFormat
$PhysicalNames
2
2 1 "skin"
3 2 "inside"
$EndPhysicalNames
$Entities
0 0 1 1
1 0 0 0 1 1 1 1 1 0
1 0 0 0 1 1 1 1 2 0
$EndEntities
$Nodes
1 5 1 5
3 1 0 5
1
2
3
4
5
0 0 0
1 0 0
0 1 0
0 0 1
1 1 1
$EndNodes
$Elements
2 8 1 8
2 1 2 6
1 1 3 2
2 1 2 4
3 1 4 3
4 2 3 5
5 2 5 4
6 3 4 5
3 1 4 2
7 1 2 3 4
8 3 2 4 5
$EndElements
"#;

#[test]
fn a_mesh_with_an_inverted_element() {
    let start = CASE.find("kind = \"box\"").expect("mesh");
    let end = CASE.find("[fluid]").expect("fluid");
    let case = format!(
        "{}kind = \"gmsh\"\nfile = \"bad.msh\"\n\n{}",
        &CASE[..start],
        &CASE[end..]
    );
    let bench = bench(&case);
    std::fs::write(bench.path("bad.msh"), INVERTED).expect("mesh file");
    refused(&bench, &[], &["bad.msh", "element", "inverted"]);
}

/// With another mesh.
fn meshed(mesh: &str) -> Bench {
    let start = CASE.find("kind = \"box\"").expect("mesh");
    let end = CASE.find("[fluid]").expect("fluid");
    bench(&format!("{}{mesh}\n\n{}", &CASE[..start], &CASE[end..]))
}

#[test]
fn vtk_meshes_that_do_not_fit_the_case() {
    let meshes = concat!(env!("CARGO_MANIFEST_DIR"), "/../meshes");
    let file = format!("kind = \"vtk\"\nfile = \"{meshes}/mixed_zlib.vtu\"\n");
    for (more, wanted) in [
        ("array = \"zone\"", "no cell array `zone`"),
        ("patches = { 7 = \"top\" }", "no surface `7` to name"),
        (
            "periodic = [{ patches = [\"surface_11\", \"top\"] }]",
            "no patch `top` to be periodic",
        ),
        (
            "periodic = [{ patches = [\"surface_11\", \"surface_12\"] }]",
            "no periodic copies of each other",
        ),
    ] {
        refused(
            &meshed(&(file.clone() + more)),
            &[],
            &["mixed_zlib.vtu", wanted],
        );
    }
    // The patches are there, but the case has conditions for others.
    refused(&meshed(&file), &[], &["no patch `y_m", "surface_11"]);
    let three = file + "periodic = [{ patches = [\"surface_11\"] }]";
    refused(&meshed(&three), &[], &["mesh.periodic[0].patches"]);
    let text = meshed("kind = \"vtk\"\nfile = \"case.toml\"");
    refused(&text, &[], &["case.toml", "this is no VTK file"]);
}

#[test]
fn openfoam_meshes_that_are_none() {
    let missing = meshed("kind = \"openfoam\"\nfolder = \"nowhere\"");
    refused(&missing, &[], &["nowhere", "no OpenFOAM mesh here"]);
}

#[test]
fn pipes_that_cannot_be() {
    let pipe = "kind = \"pipe\"\nradius = 1\nlength = 1\ncells = 2\ncore = 2\nlayers = 2\n";
    refused(
        &meshed(&(pipe.to_owned() + "core_radius = 1.0")),
        &[],
        &["mesh.core_radius = 1", "less than 1"],
    );
    refused(
        &meshed(&(pipe.to_owned() + "stretching = { geometric = 1e-300 }")),
        &[],
        &["mesh parameter `stretching`", "positive thickness"],
    );
    refused(&meshed(pipe), &[], &["no patch `y_m", "`wall`"]);
    let oblique = "fluid.initial={ kind = \"perturbed-pipe\", bulk_velocity = [1, 1, 0] }";
    let arguments = [
        "--set",
        oblique,
        "--set",
        "fluid.boundaries={ wall = { kind = \"wall\" } }",
    ];
    refused(
        &meshed(pipe),
        &arguments,
        &["bulk_velocity must point along x, y or z"],
    );
}

#[test]
fn a_mesh_file_that_is_not_there() {
    let bench = changed(
        "kind = \"box\"\nsize = [1.0, 1.0, 1.0]\ncells = [4, 4, 4]\nperiodic = [true, false, true]",
        "kind = \"gmsh\"\nfile = \"nowhere.msh\"",
    );
    refused(&bench, &[], &["nowhere.msh"]);
}

#[test]
fn an_unreadable_checkpoint() {
    let bench = bench(CASE);
    let ended = bench.run(1, "out", &[]).expect("one rank needs no mpirun");
    assert!(ended.status.success(), "{}", ended.text);
    let folder = bench.newest_checkpoint("out");
    std::fs::write(folder.join("rank_0000.h5"), "this is no HDF5 file").expect("written");
    refused(
        &bench,
        &["--resume"],
        &["step_00000002", "rank_0000.h5 is damaged"],
    );
}

#[test]
fn a_checkpoint_of_another_mesh() {
    let bench = bench(CASE);
    let ended = bench.run(1, "out", &[]).expect("one rank needs no mpirun");
    assert!(ended.status.success(), "{}", ended.text);
    let other = ["--resume", "--set", "mesh.size=[1.0, 1.0, 1.1]"];
    refused(&bench, &other, &["step 2", "another mesh"]);
}

#[test]
fn nothing_to_resume_from() {
    refused(
        &bench(CASE),
        &["--resume"],
        &["no checkpoint to resume from"],
    );
}

#[test]
fn every_rank_leaves_with_the_same_code_and_one_message() {
    let bench = changed("viscosity = 0.1", "viscosity = -0.1");
    let Some(ended) = bench.run(3, "out", &[]) else {
        return;
    };
    assert_eq!(ended.status.code(), Some(2), "{}", ended.text);
    assert_eq!(
        ended.text.matches("greater than 0").count(),
        1,
        "{}",
        ended.text
    );
}

/// The line placement of the case, to be replaced.
const LINE: &str =
    "placement = { kind = \"line\", start = [0.4, 0.5, 0.5], end = [0.6, 0.5, 0.5] }";

#[test]
fn a_population_for_which_there_is_no_room() {
    // Fibres across the channel that are longer than it is high.
    let upright = "[[fibres]]\nlength = 1.5\ndiameter = 0.01\nsegments = 4\nyoungs_modulus = 1e6\ndensity = 1000.0\nplacement = { kind = \"random\", count = 3, orientation = { kind = \"aligned\", direction = [0, 1, 0] } }";
    let bench = bench(&format!("{CASE}\n{upright}\n"));
    let wanted = [
        "fibres[1].placement",
        "there is room for 0 of 3 fibres",
        "volume fraction 0.0000",
        "shortfall",
    ];
    refused(&bench, &[], &wanted);
    let accepted = ["--set", "fibres.1.placement.shortfall=accept"];
    let ended = bench.run(1, "out", &accepted).expect("one rank");
    assert!(ended.status.success(), "{}", ended.text);
    let warned = ended.text.contains("there was no room for 3 of 3");
    assert!(warned, "{}", ended.text);
}

#[test]
fn impossible_distributions() {
    let with = |placement: &str, length: &str| {
        let random = format!("placement = {{ kind = \"random\", count = 2{placement} }}");
        changed(LINE, &format!("length = {length}\n{random}"))
    };
    let tensor =
        ", orientation = { kind = \"tensor\", tensor = [[1, 0, 0], [0, 1, 0], [0, 0, 0]] }";
    refused(
        &with(tensor, "0.1"),
        &[],
        &["fibres[0].placement", "trace is not 1"],
    );
    let normal = "{ kind = \"normal\", mean = 0.1, deviation = 0.02, min = 0.2, max = 0.1 }";
    refused(
        &with("", normal),
        &[],
        &["fibres[0].length", "length is 0.1", "above its smallest"],
    );
    refused(
        &with("", "{ kind = \"file\", file = \"lengths.csv\" }"),
        &[],
        &["fibres[0].length.file = \"lengths.csv\"", "column value"],
    );
    refused(&with("", "-0.1"), &[], &["fibres[0].length = -0.1"]);
    let pipe = ", region = { kind = \"pipe\", start = [0, 0.5, 0.5], axis = \"x\", radius = 0.6, length = 1 }";
    refused(
        &with(pipe, "0.1"),
        &[],
        &["fibres[0].placement.region", "lies outside"],
    );
}

#[test]
fn laws_that_do_not_go_together() {
    for (laws, wanted) in [
        (
            "torque = \"prolate-spheroid\"",
            ["hydrodynamics.torque", "drag = \"prolate-spheroid\""],
        ),
        (
            "drag = \"slender-body\"\nspheroid = \"bretherton\"",
            ["hydrodynamics.spheroid", "drag = \"prolate-spheroid\""],
        ),
        (
            "drag = \"infinite-cylinder\"\nslender_body = \"split\"",
            ["hydrodynamics.slender_body", "\"slender-body\""],
        ),
        (
            "slender_body = \"splitt\"",
            ["hydrodynamics.slender_body", "did you mean `split`"],
        ),
    ] {
        let bench = bench(&format!("{CASE}\n[hydrodynamics]\n{laws}\n"));
        refused(&bench, &[], &wanted);
    }
}

#[test]
fn a_rigid_fibre_with_the_inertia_of_the_fluid() {
    let rigid = "segments = 4\nkinematics = \"rigid\"";
    let case = CASE.replace("segments = 4", rigid) + "\n[hydrodynamics]\nfluid_inertia = true\n";
    refused(&bench(&case), &[], &["is rigid", "inertia of the fluid"]);
}

#[test]
fn two_fluids_and_beads_that_do_not_fit() {
    let phase = |rest: &str| {
        let table = "[phase]\nsurface_tension = 0.02\ninterface_width = 0.5\ndiffusivity = 1e-4\n";
        bench(&format!("{CASE}\n{table}{rest}\n"))
    };
    let decay = phase("initial = \"1\"\ndecay = 0.1");
    refused(&decay, &[], &["phase.decay", "time.step", "time.cfl"]);
    let formula = phase("initial = \"tanh(t)\"");
    refused(&formula, &[], &["phase.initial", "t"]);
    let infinite = phase("initial = \"1 / (x - x)\"");
    refused(&infinite, &[], &["phase.initial", "not finite"]);
    let negative = phase("initial = \"1\"\ntolerance = 0.1");
    refused(&negative, &[], &["phase.tolerance", "0.1"]);
    let beads = "[beads]\nradius = 0.1\nchains = [{ start = [0.5, 0.5, 0.5] }]\n";
    let both = bench(&format!("{CASE}\n{beads}"));
    refused(&both, &[], &["beads", "[[fibres]]"]);
    let (fluid, _) = CASE.split_once("[[fibres]]").expect("fibres come last");
    let full = bench(&format!("{fluid}\n{beads}"));
    refused(
        &full,
        &["--set=fluid.inertia=full"],
        &["[beads]", "convection"],
    );
}
