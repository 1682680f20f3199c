//! Runs every check of `mpi_checks` on 2, 3 and 4 ranks.

#![cfg(feature = "mpi")]

use fibreflow_tests::checks::CHECKS;
use fibreflow_tests::launch::{self, Ended};
use std::time::Duration;

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
    fibres_in_contact_for_long,
    fibres_in_contact_in_implicit_steps,
    probes_are_exact_on_any_ranks,
    transfer_agrees_on_any_ranks,
    coupled_ranks_agree,
    crowded_fibres_are_handed_out,
    no_segment_is_lost_in_crossings,
    multigrid_ranks_agree,
    direct_solver_ranks_agree,
    a_moved_node_is_seen_by_all,
    multigrid_where_strong_couplings_are_cut,
}

/// A failing check must fail: otherwise nothing here can.
#[test]
fn an_unknown_check_fails() {
    if let Some(ended) = mpirun("no such check", 2) {
        assert!(!ended.status.success(), "{}", ended.text);
    }
}

fn on_ranks(name: &str, ranks: &[usize]) {
    for &n in ranks {
        let Some(Ended { status, text }) = mpirun(name, n) else {
            return;
        };
        assert!(status.success(), "{name} on {n} ranks: {status}\n{text}");
    }
}

fn mpirun(name: &str, ranks: usize) -> Option<Ended> {
    let mut command = launch::command(env!("CARGO_BIN_EXE_mpi_checks"), ranks);
    command.arg(name);
    launch::run(command, TIME_OUT)
}
