//! Periodic sides of a mesh that is read: lattice vectors, and which nodes are copies of which.

use crate::{Image, Periods};

/// Parts of a period by which copies may be off their place.
pub(crate) const TOLERANCE: f64 = 1e-5;

/// A point, curve or surface that is a translated copy of another.
#[derive(Debug)]
pub(crate) struct Link {
    /// The two, for messages.
    pub names: [String; 2],
    /// From the second of them to the first, which makes a period \[m\]; None on points and curves.
    pub translation: Option<[f64; 3]>,
    /// (copy, original), by index.
    pub pairs: Vec<[u32; 2]>,
}

/// What a node of the file is: image `image` of node `master` (itself with [`Image::ZERO`] when it has no master).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Copy {
    pub master: u32,
    pub image: Image,
}

/// Lattice vectors, and the master and image of every node.
///
/// A copy of a copy (nodes on edges and corners of a box that is periodic in several directions) goes back to one
/// master, the one with the lowest images.
pub(crate) fn identify(links: &[Link], nodes: &[[f64; 3]]) -> Result<(Periods, Vec<Copy>), String> {
    let mut periods = Periods::default();
    for link in links {
        if let Some(translation) = link.translation {
            add_vector(&mut periods, translation, link)?;
        }
    }
    let mut classes = Classes::new(nodes.len());
    for link in links {
        for &[slave, master] in &link.pairs {
            let (a, b) = (nodes[master as usize], nodes[slave as usize]);
            let difference = std::array::from_fn(|c| b[c] - a[c]);
            let shift = shift_of(&periods, difference).ok_or_else(|| {
                format!(
                    "the node at {b:?} is called a periodic copy of the one at {a:?}, but no combination of the periods {:?} lies between them",
                    in_use(&periods)
                )
            })?;
            classes.join(master, slave, shift).map_err(|shift| {
                format!("the node at {b:?} is a periodic copy of itself, {shift:?} periods apart")
            })?;
        }
    }
    Ok((periods, classes.copies(nodes)?))
}

fn in_use(periods: &Periods) -> Vec<[f64; 3]> {
    let used = (0..3).filter(|&k| periods.is_periodic(k));
    used.map(|k| periods.vectors[k]).collect()
}

fn length(v: [f64; 3]) -> f64 {
    v.iter().map(|c| c * c).sum::<f64>().sqrt()
}

/// Adds a lattice vector, in the slot of its largest component where that is free, unless it is there already.
fn add_vector(periods: &mut Periods, vector: [f64; 3], link: &Link) -> Result<(), String> {
    let largest = (0..3).max_by(|&a, &b| vector[a].abs().total_cmp(&vector[b].abs()));
    let axis = largest.unwrap_or(0);
    if vector[axis] == 0.0 || !vector[axis].is_finite() {
        return Err(format!(
            "periodic surfaces {} and {} lie in the same place",
            link.names[0], link.names[1]
        ));
    }
    let vector = vector.map(|c| c * vector[axis].signum());
    let same = |k: usize| {
        let known = periods.vectors[k];
        length(std::array::from_fn(|c| known[c] - vector[c])) <= TOLERANCE * length(vector)
    };
    if (0..3).any(same) {
        return Ok(());
    }
    let mut slots = [axis, 0, 1, 2].into_iter();
    let free = slots.find(|&k| !periods.is_periodic(k));
    let slot = free.ok_or_else(|| {
        format!(
            "a fourth period {vector:?} is not supported: there are {:?}",
            in_use(periods)
        )
    })?;
    periods.vectors[slot] = vector;
    Ok(())
}

/// Multiples −1…1 of the lattice vectors that make up a difference.
fn shift_of(periods: &Periods, difference: [f64; 3]) -> Option<[i32; 3]> {
    let smallest = in_use(periods).into_iter().map(length);
    let allowed = TOLERANCE * smallest.fold(f64::INFINITY, f64::min);
    (0..27).filter_map(Image::from_code).find_map(|image| {
        let unused = |k: usize| image.shifts()[k] != 0 && !periods.is_periodic(k);
        let shift = periods.shift(image);
        let off = length(std::array::from_fn(|c| shift[c] - difference[c]));
        (!(0..3).any(unused) && off <= allowed).then(|| image.shifts().map(i32::from))
    })
}

/// Union–find whose links carry the shift from the parent.
struct Classes {
    parent: Vec<u32>,
    shift: Vec<[i32; 3]>,
}

fn add(a: [i32; 3], b: [i32; 3]) -> [i32; 3] {
    std::array::from_fn(|k| a[k] + b[k])
}

fn subtract(a: [i32; 3], b: [i32; 3]) -> [i32; 3] {
    std::array::from_fn(|k| a[k] - b[k])
}

impl Classes {
    fn new(nodes: usize) -> Self {
        Self {
            parent: (0..nodes as u32).collect(),
            shift: vec![[0; 3]; nodes],
        }
    }

    /// Root of a node and the shift from the root to the node.
    fn root(&mut self, node: u32) -> (u32, [i32; 3]) {
        let (mut root, mut shift) = (node, [0; 3]);
        while self.parent[root as usize] != root {
            shift = add(shift, self.shift[root as usize]);
            root = self.parent[root as usize];
        }
        self.parent[node as usize] = root;
        self.shift[node as usize] = shift;
        (root, shift)
    }

    /// Notes that `slave` lies `shift` from `master`; the contradiction as error.
    fn join(&mut self, master: u32, slave: u32, shift: [i32; 3]) -> Result<(), [i32; 3]> {
        let (of_master, a) = self.root(master);
        let (of_slave, b) = self.root(slave);
        let between = subtract(add(a, shift), b);
        if of_master == of_slave {
            return if between == [0; 3] {
                Ok(())
            } else {
                Err(between)
            };
        }
        self.parent[of_slave as usize] = of_master;
        self.shift[of_slave as usize] = between;
        Ok(())
    }

    fn copies(mut self, nodes: &[[f64; 3]]) -> Result<Vec<Copy>, String> {
        let count = nodes.len() as u32;
        let found: Vec<(u32, [i32; 3])> = (0..count).map(|n| self.root(n)).collect();
        // Of every class, by its root: the member with the lowest shifts.
        let mut lowest: Vec<u32> = (0..count).collect();
        for node in 0..count {
            let (root, shift) = found[node as usize];
            let best = &mut lowest[root as usize];
            let rank = |shift: [i32; 3]| (shift.iter().sum::<i32>(), shift);
            if rank(shift) < rank(found[*best as usize].1) {
                *best = node;
            }
        }
        let copy = |(node, &(root, shift)): (usize, &(u32, [i32; 3]))| {
            let master = lowest[root as usize];
            let shift = subtract(shift, found[master as usize].1);
            if shift.iter().any(|s| s.abs() > 1) {
                return Err(format!(
                    "the node at {:?} is a copy of one {shift:?} periods away; a period must reach from one side of the domain to the other",
                    nodes[node]
                ));
            }
            Ok(Copy {
                master,
                image: Image::new(shift.map(|s| s as i8)),
            })
        };
        found.iter().enumerate().map(copy).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn link(translation: [f64; 3], pairs: &[[u32; 2]]) -> Link {
        Link {
            names: ["7".into(), "3".into()],
            translation: Some(translation),
            pairs: pairs.to_vec(),
        }
    }

    /// Corners of a 2 × 1 rectangle, counter-clockwise.
    const CORNERS: [[f64; 3]; 4] = [[0.0; 3], [2.0, 0.0, 0.0], [2.0, 1.0, 0.0], [0.0, 1.0, 0.0]];

    #[test]
    fn chains_at_a_corner_end_at_one_master() {
        // Corner 2 is a copy of 1 (in y) and 1 of 0 (in x); the link for x runs against it, from right to left.
        let links = [
            link([0.0, 1.0, 0.0], &[[2, 1], [3, 0]]),
            link([-2.0, 0.0, 0.0], &[[0, 1], [3, 2]]),
        ];
        let (periods, copies) = identify(&links, &CORNERS).expect("periodic");
        assert_eq!(
            periods.vectors,
            [[2.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0; 3]]
        );
        let images = [[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 0]];
        for (copy, image) in copies.iter().zip(images) {
            assert_eq!(
                *copy,
                Copy {
                    master: 0,
                    image: Image::new(image)
                }
            );
        }
    }

    #[test]
    fn what_cannot_be_a_lattice_is_refused() {
        let refused = |link: Link| identify(&[link], &CORNERS).expect_err("refused");
        assert!(refused(link([2.0, 0.0, 0.0], &[[2, 0]])).contains("no combination"));
        assert!(refused(link([0.0; 3], &[])).contains("7 and 3 lie in the same place"));
    }
}
