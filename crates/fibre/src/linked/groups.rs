//! Groups of segments that are linked by contacts (S 2.4), by union and find.

use super::touch::Touch;

/// Contacts that rub, sorted into groups that share segments.
#[derive(Clone, Debug, Default)]
pub(super) struct Groups {
    /// Indices of contacts, group by group, in ascending order in each.
    pub contacts: Vec<u32>,
    /// First contact of each group and, last, their number.
    pub starts: Vec<u32>,
    /// Segments of the groups, one group after another.
    pub members: Vec<u32>,
    /// First member of each group and, last, their number.
    pub member_starts: Vec<u32>,
    /// By segment: its place among the members of its group. Only of segments that rub.
    pub place: Vec<u32>,
    parent: Vec<u32>,
    group_of: Vec<u32>,
}

const NONE: u32 = u32::MAX;

impl Groups {
    /// Number of groups.
    pub fn count(&self) -> usize {
        self.starts.len().saturating_sub(1)
    }

    /// Sorts the contacts among `segments` segments.
    pub fn sort(&mut self, touches: &[Touch], segments: usize) {
        self.parent.clear();
        self.parent.extend(0..segments as u32);
        self.group_of.resize(segments, NONE);
        self.group_of.fill(NONE);
        self.place.resize(segments, NONE);
        self.place.fill(NONE);
        let rubs = || touches.iter().enumerate().filter(|(_, t)| t.rubs);
        for (_, t) in rubs() {
            let [a, b] = t.segments.map(|s| root(&mut self.parent, s));
            // The lower index leads, whatever the order of the contacts.
            self.parent[a.max(b) as usize] = a.min(b);
        }
        // Groups are numbered by their first contact; a counting sort keeps contacts in order.
        self.starts.clear();
        self.starts.push(0);
        for (_, t) in rubs() {
            let group = self.number(t.segments[0]);
            self.starts[group as usize + 1] += 1;
        }
        let groups = self.starts.len() - 1;
        for g in 0..groups {
            self.starts[g + 1] += self.starts[g];
        }
        let mut next: Vec<u32> = self.starts[..groups].to_vec();
        self.contacts.resize(self.starts[groups] as usize, 0);
        for (k, t) in rubs() {
            let group = self.number(t.segments[0]) as usize;
            self.contacts[next[group] as usize] = k as u32;
            next[group] += 1;
        }
        self.members.clear();
        self.member_starts.clear();
        for g in 0..groups {
            let first = self.members.len();
            self.member_starts.push(first as u32);
            for &k in &self.contacts[self.starts[g] as usize..self.starts[g + 1] as usize] {
                for s in touches[k as usize].segments {
                    if self.place[s as usize] == NONE {
                        self.place[s as usize] = (self.members.len() - first) as u32;
                        self.members.push(s);
                    }
                }
            }
        }
        self.member_starts.push(self.members.len() as u32);
    }

    fn number(&mut self, segment: u32) -> u32 {
        let leader = root(&mut self.parent, segment) as usize;
        if self.group_of[leader] == NONE {
            self.group_of[leader] = self.starts.len() as u32 - 1;
            self.starts.push(0);
        }
        self.group_of[leader]
    }
}

/// The leader of a segment's group.
pub(super) fn root(parent: &mut [u32], mut s: u32) -> u32 {
    while parent[s as usize] != s {
        // Halving the path keeps trees flat.
        parent[s as usize] = parent[parent[s as usize] as usize];
        s = parent[s as usize];
    }
    s
}
