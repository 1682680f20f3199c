//! Node tags of a file to indices 0, 1, 2….

/// Tags in ascending order with their index; binary search, or none where tags follow each other.
pub(super) struct Tags {
    sorted: Vec<(u64, u32)>,
    consecutive: bool,
}

impl Tags {
    /// Index k for the k-th tag.
    pub fn new(tags: &[u64]) -> Result<Self, String> {
        if u32::try_from(tags.len()).is_err() {
            return Err(format!(
                "{} nodes are more than 32-bit indices can name",
                tags.len()
            ));
        }
        let mut sorted: Vec<(u64, u32)> = tags.iter().zip(0..).map(|(&t, k)| (t, k)).collect();
        sorted.sort_unstable();
        if let Some(pair) = sorted.windows(2).find(|w| w[0].0 == w[1].0) {
            return Err(format!("node {} is listed twice", pair[0].0));
        }
        let consecutive = sorted.windows(2).all(|w| w[0].0 + 1 == w[1].0);
        Ok(Self {
            sorted,
            consecutive,
        })
    }

    /// Index of a tag.
    pub fn index(&self, tag: u64) -> Result<u32, String> {
        let place = if self.consecutive {
            let first = self.sorted.first().map_or(0, |s| s.0);
            tag.checked_sub(first)
                .and_then(|k| self.sorted.get(k as usize))
        } else {
            let found = self.sorted.binary_search_by_key(&tag, |s| s.0);
            found.ok().map(|k| &self.sorted[k])
        };
        place
            .map(|s| s.1)
            .ok_or_else(|| format!("node {tag} is used but not listed in $Nodes"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tags_with_and_without_gaps() {
        for list in [[5u64, 3, 4], [50, 3, 4]] {
            let tags = Tags::new(&list).expect("tags");
            for (k, &tag) in list.iter().enumerate() {
                assert_eq!(tags.index(tag), Ok(k as u32));
            }
            assert!(tags.index(2).is_err());
            assert!(tags.index(6).is_err());
        }
        assert!(Tags::new(&[1, 2, 1]).is_err());
    }
}
