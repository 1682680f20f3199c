//! Iterations and time of the pressure solvers on hard and easy meshes.
//!
//! `poisson list` prints the names of the cases; `poisson CASE [--methods a,b] [--write FILE] [--tolerance 1e-8]` solves one
//! of them and prints a line of CSV a method. Pure Neumann problems with a random right-hand side of mean zero, from zero, to
//! a residual relative to it; set-up and solve the best of three. `--write` leaves matrix and right-hand side behind in
//! PETSc's binary format. Ranks of MPI (feature `fibreflow-parallel/mpi`) share a case; threads are rayon's.

mod cases;
mod petsc;

use fibreflow_mesh::{Line, LocalMesh, TensorGrid, distribute_from, geometry, renumber};
use fibreflow_parallel::Communicator;
use fibreflow_solve::{
    Amg, AmgSettings, CgSettings, ConjugateGradients, Deflation, DeflationSettings, Direct, Jacobi,
    NullSpace, PairMatrix, Preconditioner, SolveReport,
};
use rand::{Rng, SeedableRng};
use std::error::Error;
use std::time::Instant;

type Outcome<T = ()> = Result<T, Box<dyn Error + Send + Sync>>;

const REPEATS: usize = 3;

struct Options {
    case: String,
    methods: Vec<String>,
    write: Option<String>,
    tolerance: f64,
    nodes: usize,
}

impl Options {
    fn parse(mut arguments: impl Iterator<Item = String>) -> Outcome<Self> {
        let mut options = Self {
            case: arguments.next().ok_or("which case? `list` names them")?,
            methods: ["amg", "direct", "deflation", "jacobi"]
                .map(str::to_owned)
                .to_vec(),
            write: None,
            tolerance: 1e-8,
            nodes: DeflationSettings::default().nodes,
        };
        while let Some(key) = arguments.next() {
            let value = arguments
                .next()
                .ok_or_else(|| format!("{key} needs a value"))?;
            match key.as_str() {
                "--methods" => options.methods = value.split(',').map(str::to_owned).collect(),
                "--write" => options.write = Some(value),
                "--group" => options.nodes = value.parse()?,
                "--tolerance" => options.tolerance = value.parse()?,
                _ => return Err(format!("unknown option {key}").into()),
            }
        }
        Ok(options)
    }
}

/// What is solved, and how far.
struct Problem {
    mesh: LocalMesh,
    matrix: PairMatrix,
    rhs: Vec<f64>,
    settings: CgSettings,
    nodes: usize,
}

fn main() -> Outcome {
    let options = Options::parse(std::env::args().skip(1))?;
    if options.case == "list" {
        cases::all().iter().for_each(|(name, _)| println!("{name}"));
        return Ok(());
    }
    let communicator = Communicator::world()?;
    let problem = Problem::new(&options, &communicator)?;
    if communicator.is_root() {
        println!("method,unknowns,iterations,set_up,solve,residual,levels,complexity");
    }
    for method in &options.methods {
        problem.measure(method)?;
    }
    Ok(())
}

impl Problem {
    fn new(options: &Options, communicator: &Communicator) -> Outcome<Self> {
        let cases = cases::all();
        let find = cases.iter().find(|(name, _)| *name == options.case);
        let (_, case) = find.ok_or("no such case; `list` names them")?;
        let mesh = distribute_from(communicator, || {
            let mut mesh = case.build()?;
            renumber(&mut mesh)?;
            Ok(mesh)
        })?;
        let dual = geometry::dual(&mesh)?;
        let matrix = PairMatrix::new(&mesh, &dual, &vec![false; mesh.total()], None)?;
        // By global node: the same on any number of ranks.
        let random = |&node: &u64| {
            let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(node);
            random.random_range(-1.0..1.0)
        };
        let mut rhs: Vec<f64> = mesh.global_nodes[..mesh.owned()]
            .iter()
            .map(random)
            .collect();
        let mut sums = [rhs.iter().sum(), rhs.len() as f64];
        communicator.sum_slice(&mut sums);
        rhs.iter_mut().for_each(|b| *b -= sums[0] / sums[1]);
        if let Some(path) = &options.write {
            petsc::write(path, &mesh, &dual, &rhs)?;
        }
        let settings = CgSettings {
            relative_tolerance: options.tolerance,
            max_iterations: 20_000,
            ..CgSettings::default()
        };
        Ok(Self {
            mesh,
            matrix,
            rhs,
            settings,
            nodes: options.nodes,
        })
    }

    fn measure(&self, method: &str) -> Outcome {
        match method {
            "amg" => {
                let build = || Ok(Amg::new(&self.matrix, AmgSettings::default())?);
                let of = |amg: &Amg| (amg.unknowns().len(), amg.operator_complexity());
                self.run(method, build, of)
            }
            "deflation" => {
                let build = || {
                    let settings = DeflationSettings { nodes: self.nodes };
                    Ok(Deflation::new(&self.matrix, settings)?)
                };
                self.run(method, build, |d| {
                    (2, 1.0 + d.groups() as f64 / self.mesh.owned() as f64)
                })
            }
            "none" => Ok(()),
            "jacobi" => self.run(method, || Ok(Jacobi::new(&self.matrix)), |_| (1, 1.0)),
            "direct" => {
                let Some(grid) = TensorGrid::detect(&self.mesh) else {
                    return Ok(());
                };
                let line = |d: usize| Line::second(&grid.coordinates[d], grid.periods[d]);
                let lines: [Line; 3] = std::array::from_fn(line);
                let free = [[false; 2]; 3];
                let build = || Ok(Direct::new(&self.mesh.halo, &grid, &lines, free, 0.0)?);
                self.run(method, build, |_| (1, 1.0))
            }
            _ => Err(format!("unknown method {method}").into()),
        }
    }

    fn run<P: Preconditioner<f64>>(
        &self,
        method: &str,
        build: impl Fn() -> Outcome<P>,
        describe: impl Fn(&P) -> (usize, f64),
    ) -> Outcome {
        let communicator = self.mesh.halo.communicator();
        let best =
            |best: f64, start: Instant| communicator.max(start.elapsed().as_secs_f64()).min(best);
        let (mut set_up, mut solve) = (f64::INFINITY, f64::INFINITY);
        let mut outcome = None;
        let mut solver = ConjugateGradients::new();
        for _ in 0..REPEATS {
            communicator.barrier();
            let start = Instant::now();
            let mut preconditioner = build()?;
            set_up = best(set_up, start);
            let mut x = vec![0.0; self.mesh.total()];
            communicator.barrier();
            let start = Instant::now();
            let report = self.solve(&mut solver, &mut preconditioner, &mut x)?;
            solve = best(solve, start);
            outcome = Some((report, x, describe(&preconditioner)));
        }
        let (report, mut x, (levels, complexity)) = outcome.ok_or("no run")?;
        let residual = self.residual(&mut x);
        let unknowns = communicator.sum_count(self.mesh.owned());
        if communicator.is_root() {
            let iterations = report.iterations;
            println!(
                "{method},{unknowns},{iterations},{set_up:.4},{solve:.4},{residual:.2e},{levels},{complexity:.3}"
            );
        }
        Ok(())
    }

    fn solve(
        &self,
        solver: &mut ConjugateGradients<f64>,
        preconditioner: &mut impl Preconditioner<f64>,
        x: &mut [f64],
    ) -> Outcome<SolveReport> {
        let (matrix, constant) = (&self.matrix, NullSpace::Constant);
        Ok(solver.solve(
            matrix,
            preconditioner,
            &self.rhs,
            x,
            &self.settings,
            constant,
        )?)
    }

    /// ‖b − A x‖/‖b‖, computed anew.
    fn residual(&self, x: &mut [f64]) -> f64 {
        let mut image = vec![0.0; self.mesh.owned()];
        self.matrix.multiply(x, &mut image);
        let rest = self.rhs.iter().zip(&image).map(|(b, y)| (b - y) * (b - y));
        let mut squares = [rest.sum(), self.rhs.iter().map(|b| b * b).sum()];
        self.mesh.halo.communicator().sum_slice(&mut squares);
        (squares[0] / squares[1]).sqrt()
    }
}
