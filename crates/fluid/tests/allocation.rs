//! After its first steps a flow does not touch the heap.

mod common;

use common::{fluid_in, of};
use fibreflow_fluid::{
    BoundaryCondition, Fluid, FluidSettings, Forcing, Kernels, PressurePreconditioner,
};
use fibreflow_mesh::{BoxElement, BoxMesh, renumber};
use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::atomic::{AtomicUsize, Ordering};

struct Counting;

static ALLOCATIONS: AtomicUsize = AtomicUsize::new(0);

// SAFETY: every call is passed on to the system allocator unchanged.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        ALLOCATIONS.fetch_add(1, Ordering::Relaxed);
        // SAFETY: the caller's promise.
        unsafe { System.alloc(layout) }
    }

    unsafe fn dealloc(&self, pointer: *mut u8, layout: Layout) {
        // SAFETY: the caller's promise.
        unsafe { System.dealloc(pointer, layout) }
    }
}

#[global_allocator]
static COUNTING: Counting = Counting;

fn channel(element: BoxElement, settings: FluidSettings) -> Fluid {
    let mesh = BoxMesh {
        periodic: [true, false, true],
        ..of(element, [2.0, 1.0, 1.0], [24, 20, 18], 0.0)
    };
    let mut mesh = mesh.build().expect("box");
    renumber(&mut mesh).expect("order");
    let settings = FluidSettings {
        forcing: Forcing::BulkVelocity {
            direction: [1.0, 0.0, 0.0],
            value: 1.0,
        },
        ..settings
    };
    let mut fluid = fluid_in(mesh, settings, |_| BoundaryCondition::WALL);
    fluid
        .set_velocity(|[x, y, z]| {
            [
                y * (1.0 - y),
                0.1 * (3.1 * x).sin() * y * (1.0 - y),
                0.1 * z.sin(),
            ]
        })
        .expect("start");
    fluid
}

fn allocations(fluid: &mut Fluid, dt: f64) -> usize {
    for _ in 0..3 {
        fluid.advance(dt).expect("step");
    }
    let before = ALLOCATIONS.load(Ordering::Relaxed);
    for _ in 0..3 {
        fluid.advance(dt).expect("step");
    }
    ALLOCATIONS.load(Ordering::Relaxed) - before
}

/// One test: the count is that of the whole process.
#[test]
fn steps_do_not_allocate() {
    // Tasks handed to a pool from outside may allocate; tasks of its own do not.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    pool.expect("pool").install(|| {
        let plain = FluidSettings::new(1.0, 1e-3);
        let general = FluidSettings {
            kernels: Kernels::Rows,
            preconditioner: PressurePreconditioner::Amg,
            ..plain.clone()
        };
        for (name, element, settings, dt) in [
            ("lines, direct", BoxElement::Hexahedron, plain.clone(), 0.01),
            (
                "rows, multigrid",
                BoxElement::Hexahedron,
                general.clone(),
                0.01,
            ),
            ("implicit diffusion", BoxElement::Hexahedron, general, 0.5),
            (
                "lines, implicit diffusion",
                BoxElement::Hexahedron,
                plain.clone(),
                0.5,
            ),
            ("tetrahedra", BoxElement::Tetrahedron, plain, 0.01),
        ] {
            let settings = FluidSettings {
                viscosity: if dt > 0.1 { 0.1 } else { settings.viscosity },
                ..settings
            };
            let mut fluid = channel(element, settings);
            let dt = fluid.suggest_dt(0.5, dt);
            let found = allocations(&mut fluid, dt);
            assert_eq!(found, 0, "{name}: {found} allocations in three steps");
        }
    });
}
