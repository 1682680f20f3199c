//! Checks that need several ranks: run by `mpi_checks <name>` under `mpirun`, see `tests/mpi.rs`.
//!
//! A check is a collective function that returns what is wrong. To add one: write it in a file here, list it in
//! [`CHECKS`], and name it in `tests/mpi.rs`.

use fibreflow_parallel::Communicator;

mod contact;
mod coupled;
pub mod coupling;
mod direct;
mod distribution;
mod fibres;
mod geometry;
mod halo;
pub mod meshes;
mod poisson;
mod probes;

/// What a failing check says.
pub type Outcome = Result<(), Box<dyn std::error::Error>>;

/// Runs on all ranks.
pub type Check = fn(&Communicator) -> Outcome;

/// Name and function of every check.
pub const CHECKS: &[(&str, Check)] = &[
    ("halo_is_adjoint", halo::adjoint),
    ("halo_brings_the_owners_values", halo::owners_values),
    (
        "no_rank_holds_the_mesh",
        distribution::no_rank_holds_the_mesh,
    ),
    (
        "messages_scale_with_the_interface",
        distribution::messages_scale,
    ),
    (
        "geometry_is_the_same_on_any_ranks",
        geometry::same_on_any_ranks,
    ),
    (
        "an_inverted_element_stops_all_ranks",
        geometry::inverted_elements_stop_all,
    ),
    (
        "an_error_on_rank_0_reaches_all",
        distribution::errors_reach_all,
    ),
    (
        "contacts_do_not_depend_on_the_ranks",
        contact::independent_of_the_ranks,
    ),
    (
        "a_short_periodic_box_is_refused_by_all_ranks",
        contact::short_box,
    ),
    (
        "fibres_change_owner_unnoticed",
        fibres::migration_changes_nothing,
    ),
    ("fibres_in_contact_for_long", fibres::long_contact),
    (
        "fibres_in_contact_in_implicit_steps",
        fibres::implicit_contact,
    ),
    ("probes_are_exact_on_any_ranks", probes::exact_on_any_ranks),
    ("transfer_agrees_on_any_ranks", coupling::ranks_agree),
    ("coupled_ranks_agree", coupled::ranks_agree),
    (
        "crowded_fibres_are_handed_out",
        coupling::crowded_fibres_are_handed_out,
    ),
    (
        "no_segment_is_lost_in_crossings",
        coupling::no_segment_is_lost_in_crossings,
    ),
    ("multigrid_ranks_agree", poisson::ranks_agree),
    ("direct_solver_ranks_agree", direct::ranks_agree),
    (
        "a_moved_node_is_seen_by_all",
        direct::a_moved_node_is_seen_by_all,
    ),
    (
        "multigrid_where_strong_couplings_are_cut",
        poisson::strong_couplings_cut,
    ),
];

/// Error with a message unless `holds`.
///
/// # Errors
/// When `holds` is false.
pub fn ensure(holds: bool, message: impl FnOnce() -> String) -> Outcome {
    if holds { Ok(()) } else { Err(message().into()) }
}
