//! Runs every check of `mpi_checks` on 2, 3 and 4 ranks.

#![cfg(feature = "mpi")]

use fibreflow_tests::checks::CHECKS;
use std::fs::File;
use std::process::{Child, Command, ExitStatus, Stdio};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

const TIME_OUT: Duration = Duration::from_secs(30);

/// One test a check, and one that none is forgotten.
macro_rules! mpi_checks {
    ($($name:ident),* $(,)?) => {
        $(#[test]
        fn $name() {
            on_ranks(stringify!($name), &[2, 3, 4]);
        })*

        #[test]
        fn every_check_is_run() {
            let run = [$(stringify!($name)),*];
            for (name, _) in CHECKS {
                assert!(run.contains(name), "`{name}` is not run");
            }
        }
    };
}

mpi_checks! {
    halo_is_adjoint,
    halo_brings_the_owners_values,
    no_rank_holds_the_mesh,
    messages_scale_with_the_interface,
    geometry_is_the_same_on_any_ranks,
    an_inverted_element_stops_all_ranks,
    an_error_on_rank_0_reaches_all,
    contacts_do_not_depend_on_the_ranks,
    a_short_periodic_box_is_refused_by_all_ranks,
    fibres_change_owner_unnoticed,
    transfer_agrees_on_any_ranks,
    coupled_ranks_agree,
    crowded_fibres_are_handed_out,
    multigrid_ranks_agree,
    multigrid_where_strong_couplings_are_cut,
}

/// A failing check must fail: otherwise nothing here can.
#[test]
fn an_unknown_check_fails() {
    if let Some((status, output)) = mpirun("no such check", 2) {
        assert!(!status.success(), "{output}");
    }
}

fn on_ranks(name: &str, ranks: &[usize]) {
    for &n in ranks {
        let Some((status, output)) = mpirun(name, n) else {
            return;
        };
        assert!(status.success(), "{name} on {n} ranks: {status}\n{output}");
    }
}

/// Exit status and output; None, with a note, where there is no `mpirun`.
fn mpirun(name: &str, ranks: usize) -> Option<(ExitStatus, String)> {
    // One job at a time: the ranks of one are already more than most machines that test have cores.
    static ONE: Mutex<()> = Mutex::new(());
    let _guard = ONE.lock().unwrap_or_else(PoisonError::into_inner);
    let folder = tempfile::tempdir().expect("temporary folder");
    let path = folder.path().join("output");
    let output = File::create(&path).expect("output file");
    let mut command = Command::new("mpirun");
    command
        .args(["--oversubscribe", "--bind-to", "none", "-n"])
        .arg(ranks.to_string())
        .arg(env!("CARGO_BIN_EXE_mpi_checks"))
        .arg(name)
        .envs([
            ("RAYON_NUM_THREADS", "1"),
            ("OMPI_ALLOW_RUN_AS_ROOT", "1"),
            ("OMPI_ALLOW_RUN_AS_ROOT_CONFIRM", "1"),
            ("OMPI_MCA_btl_vader_eager_limit", "65536"),
            // Ranks that wait give their core to the others.
            ("OMPI_MCA_mpi_yield_when_idle", "1"),
        ])
        .stdin(Stdio::null())
        .stdout(output.try_clone().expect("output file"))
        .stderr(output);
    match command.spawn() {
        Ok(child) => {
            let status = wait(child, name, ranks);
            let text = std::fs::read_to_string(&path).unwrap_or_default();
            Some((status, text))
        }
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
            eprintln!("skipped: mpirun is not installed");
            None
        }
        Err(error) => panic!("mpirun: {error}"),
    }
}

fn wait(mut child: Child, name: &str, ranks: usize) -> ExitStatus {
    let start = Instant::now();
    while start.elapsed() < TIME_OUT {
        if let Some(status) = child.try_wait().expect("mpirun") {
            return status;
        }
        std::thread::sleep(Duration::from_millis(20));
    }
    // On SIGTERM mpirun stops its ranks; killed outright it would leave them running.
    let _ = Command::new("kill").arg(child.id().to_string()).status();
    std::thread::sleep(Duration::from_secs(2));
    let _ = child.kill();
    let _ = child.wait();
    panic!("{name} on {ranks} ranks did not end within {TIME_OUT:?}");
}
