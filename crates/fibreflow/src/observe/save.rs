//! Between the state of a scene and a checkpoint.

use crate::checkpoint::{CheckpointError, NodeField, PairField, Snapshot};
use crate::clock::Clock;
use crate::error::ProgramError;
use crate::scene::{Flow, Scene};
use fibreflow_fibre::linked::LinkedSystem;
use fibreflow_fibre::{FibreRecord, FibreState, FibreSystem};
use fibreflow_fluid::FluidState;

const TIME: &str = "run.time";
const DT: &str = "run.dt";
/// Records of the beads, and number by number.
const BEADS: &str = "beads";
/// ∂u/∂t of the last step, for fibres in the flow of the next.
const SLOPE: &str = "coupling.slope";
/// Upper and lower half of the checksum of the mesh; numbers of 32 bits are exact in a float.
const MESH: [&str; 2] = ["run.mesh_high", "run.mesh_low"];

/// Everything a resumed run needs.
pub fn snapshot(scene: &Scene, clock: &Clock) -> Snapshot {
    let mut snapshot = Snapshot {
        step: clock.step,
        scalars: vec![(TIME.into(), clock.time), (DT.into(), clock.dt)],
        ..Snapshot::default()
    };
    let halves = mesh_halves(scene);
    let named = MESH.iter().map(|n| (*n).to_owned()).zip(halves);
    snapshot.scalars.extend(named);
    if let Some(fluid) = scene.flow.fluid() {
        let state = fluid.state();
        let (mesh, geometry) = (fluid.mesh(), fluid.geometry());
        let owned = mesh.owned();
        snapshot.nodes = mesh.global_nodes[..owned].to_vec();
        snapshot.row_lengths = (0..owned).map(|i| geometry.row(i).len() as u32).collect();
        let node = |(name, width, values)| NodeField {
            name,
            width,
            values,
        };
        let slope = scene.flow.exchange().map_or(&[][..], |e| &e.slope);
        let pair = |(name, values)| PairField { name, values };
        snapshot.node_fields = state.node.into_iter().map(node).collect();
        if !slope.is_empty() {
            snapshot.node_fields.push(NodeField {
                name: SLOPE.into(),
                width: 3,
                values: slope[..owned]
                    .iter()
                    .flat_map(|s| [s[0], s[1], s[2]])
                    .collect(),
            });
        }
        snapshot.pair_fields = state.pair.into_iter().map(pair).collect();
        snapshot.scalars.extend(state.scalars);
        if let Some(phase) = scene.flow.phase() {
            let state = phase.field.state();
            snapshot
                .node_fields
                .extend(state.node.into_iter().map(node));
            snapshot.scalars.extend(state.scalars);
        }
        if let Some(beads) = scene.flow.beads() {
            let named = beads.state().into_iter().enumerate();
            let named = named.map(|(k, value)| (format!("{BEADS}.{k}"), value));
            snapshot.scalars.extend(named);
        }
    }
    let beams = scene.fibres.as_ref().map(FibreSystem::state);
    let linked = scene.linked.as_ref().map(LinkedSystem::state);
    if let Some(state) = beams.or(linked) {
        for record in state.records {
            snapshot.fibres.push(record.id, record.words);
        }
        snapshot.scalars.extend(state.scalars);
    }
    snapshot
}

/// Puts a checkpoint's state into a scene that was set up from the same case, and the clock where it was. Collective.
///
/// # Errors
/// A checkpoint that does not fit the case.
pub fn restore(
    scene: &mut Scene,
    clock: &mut Clock,
    snapshot: Snapshot,
) -> Result<(), ProgramError> {
    let scalar = |name: &str| {
        let found = snapshot.scalars.iter().find(|(n, _)| n == name);
        found.map(|(_, v)| *v)
    };
    let foreign = |reason: &str| {
        ProgramError::input(CheckpointError::Foreign {
            path: format!("of step {}", snapshot.step),
            reason: reason.to_owned(),
        })
    };
    let (Some(time), Some(dt)) = (scalar(TIME), scalar(DT)) else {
        return Err(foreign("it holds no time"));
    };
    if MESH.map(scalar) != mesh_halves(scene).map(Some) {
        return Err(foreign("it was made on another mesh"));
    }
    (clock.step, clock.time, clock.dt) = (snapshot.step, time, dt);
    if let Flow::Solved(solved) = &mut scene.flow {
        let named = snapshot.node_fields.iter().find(|f| f.name == SLOPE);
        if let Some(field) = named {
            let rows = field.values.chunks_exact(3);
            let mut slope: Vec<_> = rows.map(|s| [s[0], s[1], s[2], 0.0]).collect();
            slope.resize(solved.fluid.mesh().total(), [0.0; 4]);
            solved.fluid.mesh().halo.update(&mut slope);
            solved.exchange.slope = slope;
        }
        let state = FluidState {
            node: snapshot
                .node_fields
                .into_iter()
                .map(|f| (f.name, f.width, f.values))
                .collect(),
            pair: snapshot
                .pair_fields
                .into_iter()
                .map(|f| (f.name, f.values))
                .collect(),
            scalars: snapshot.scalars.clone(),
        };
        if let Some(phase) = &mut solved.phase {
            let restored = phase.field.restore(&solved.fluid, &state);
            restored.map_err(ProgramError::input)?;
        }
        solved.fluid.restore(state).map_err(ProgramError::input)?;
        if let Some(beads) = &mut solved.beads {
            let numbers = (0..).map_while(|k| scalar(&format!("{BEADS}.{k}")));
            beads.restore(&numbers.collect::<Vec<f64>>());
        }
        solved.place_beads();
    }
    if scene.fibres.is_some() || scene.linked.is_some() {
        let record = |(id, words): (u64, &[u64])| FibreRecord {
            id,
            words: words.to_vec(),
        };
        let state = FibreState {
            records: snapshot.fibres.iter().map(record).collect(),
            scalars: snapshot.scalars,
        };
        let restored = match (&mut scene.fibres, &mut scene.linked) {
            (Some(fibres), _) => fibres.restore(state),
            (None, Some(linked)) => linked.restore(state),
            (None, None) => Ok(()),
        };
        restored.map_err(ProgramError::input)?;
    }
    Ok(())
}

fn mesh_halves(scene: &Scene) -> [f64; 2] {
    let checksum = scene.mesh_checksum.unwrap_or(0);
    [(checksum >> 32) as u32, checksum as u32].map(f64::from)
}
