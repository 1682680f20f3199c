//! Where a series becomes steady, and how well its mean is known.

/// Blocks in which the start of the steady part is looked for.
const SEARCHED: usize = 40;
/// Blocks from whose means the error of a mean comes.
const BLOCKS: usize = 8;

/// Index from which the mean has the least standard error (White 1997, Simulation 69:323, on block means); at most three
/// quarters of the way.
pub fn start(values: &[f64]) -> usize {
    let size = (values.len() / SEARCHED).max(1);
    let means: Vec<f64> = values.chunks_exact(size).map(mean).collect();
    let error = |k: &usize| {
        let rest = &means[*k..];
        let middle = mean(rest);
        let square = rest.iter().map(|x| (x - middle).powi(2)).sum::<f64>();
        square / (rest.len() * rest.len()) as f64
    };
    let starts = (0..(3 * means.len() / 4).max(1)).map(|k| (k, error(&k)));
    let best = starts.min_by(|a, b| a.1.total_cmp(&b.1));
    best.map_or(0, |(k, _)| k * size)
}

/// Mean; not a number without values.
pub fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// Standard error of the mean of independent values; not a number for fewer than two.
pub fn standard_error(values: &[f64]) -> f64 {
    let (n, middle) = (values.len() as f64, mean(values));
    let square = values.iter().map(|x| (x - middle).powi(2)).sum::<f64>();
    if values.len() < 2 {
        return f64::NAN;
    }
    (square / (n - 1.0) / n).sqrt()
}

/// Mean of a series and its standard error by means of blocks; the error is not a number where lines are fewer than blocks.
pub fn block_mean(values: &[f64]) -> [f64; 2] {
    let size = values.len() / BLOCKS;
    if size == 0 {
        return [mean(values), f64::NAN];
    }
    let means: Vec<f64> = values.chunks_exact(size).take(BLOCKS).map(mean).collect();
    [mean(values), standard_error(&means)]
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A decay onto waves about 2.
    fn series(decay: f64) -> Vec<f64> {
        let value = |k: usize| {
            let t = k as f64 * 0.1;
            2.0 + 0.1 * (7.0 * t).sin() + 5.0 * (-t / decay).exp()
        };
        (0..2000).map(value).collect()
    }

    #[test]
    fn the_start_follows_the_decay() {
        let [short, long] = [2.0, 10.0].map(|decay| start(&series(decay)) as f64 * 0.1);
        assert!((4.0..40.0).contains(&short), "{short}");
        assert!((20.0..100.0).contains(&long), "{long}");
        let values = series(10.0);
        let [all, _] = block_mean(&values);
        let [steady, error] = block_mean(&values[start(&values)..]);
        assert!(
            all > 2.2 && (steady - 2.0).abs() < 0.02 && error < 0.01,
            "{all} {steady} {error}"
        );
        assert_eq!(start(&[1.0; 500]), 0);
        assert_eq!(start(&[3.0]), 0);
    }

    #[test]
    fn errors_of_means() {
        assert!((standard_error(&[1.0, 2.0, 3.0]) - (1.0_f64 / 3.0).sqrt()).abs() < 1e-15);
        assert!(standard_error(&[1.0]).is_nan());
        let two = [0.0, 1.0].repeat(8);
        assert_eq!(block_mean(&two), [0.5, 0.0]);
        assert!(block_mean(&[1.0, 2.0])[1].is_nan());
    }
}
