//! A step of creeping flow does not touch the heap once its directions are there.

mod common;

use common::{fluid_on, of, settings};
use fibreflow_fluid::{BoundaryCondition, Inertia, Signal, VelocityProfile};
use fibreflow_mesh::{BoxElement, BoxMesh};
use std::alloc::{GlobalAlloc, Layout, System};
use std::sync::Arc;
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

#[test]
fn a_step_after_warm_up_allocates_nothing() {
    // Tasks handed to a pool from outside may allocate; tasks of its own do not.
    let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
    pool.expect("pool").install(steps);
}

fn steps() {
    for (inertia, element) in [
        (Inertia::Linear, BoxElement::Hexahedron),
        (Inertia::Steady, BoxElement::Tetrahedron),
    ] {
        let mesh = BoxMesh {
            periodic: [true, false, true],
            ..of(element, [1.0, 0.8, 0.6], [8, 8, 6], 0.0)
        };
        let mut settings = settings(1.3, 0.7, 1e-8);
        settings.inertia = inertia;
        let mut fluid = fluid_on(&mesh, settings, |name| match name {
            "y_max" => BoundaryCondition::MovingWall {
                profile: VelocityProfile::Uniform([0.02, 0.0, 0.0])
                    .scaled(Signal::Function(Arc::new(|t| (9.0 * t).cos()))),
            },
            _ => BoundaryCondition::WALL,
        });
        for _ in 0..4 {
            fluid.advance(0.05).expect("step");
        }
        for step in 0..3 {
            let before = ALLOCATIONS.load(Ordering::Relaxed);
            fluid.advance(0.05).expect("step");
            let found = ALLOCATIONS.load(Ordering::Relaxed) - before;
            assert_eq!(found, 0, "{inertia:?}, step {step}");
        }
    }
}
