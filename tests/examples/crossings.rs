//! A million segments that cross rank or periodic boundaries: `mpirun -n 4 target/release/examples/crossings`

use fibreflow_parallel::Communicator;
use fibreflow_tests::checks::coupling::crossings;

fn main() -> Result<(), Box<dyn std::error::Error>> {
    let world = Communicator::world()?;
    crossings(&world, 1100, 1e6)?;
    if world.is_root() {
        println!(
            "{} ranks: no segment lost in a million crossings",
            world.size()
        );
    }
    Ok(())
}
