//! Tables of numbers in CSV files.

use std::path::Path;

/// Named columns of numbers.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Csv {
    names: Vec<String>,
    /// Line by line.
    values: Vec<f64>,
}

impl Csv {
    /// Reads a file whose first line holds the names of the columns; these have to be among `known`.
    ///
    /// # Errors
    /// What is wrong, and in which line.
    pub fn read(path: &Path, known: &[&str]) -> Result<Self, String> {
        let text = std::fs::read_to_string(path).map_err(|e| e.to_string())?;
        let mut lines = text.lines().enumerate();
        let cells = |line: &str| -> Vec<String> {
            let cells = line.split(',').map(|c| c.trim().trim_matches('"'));
            cells.map(str::to_owned).collect()
        };
        let names = lines.next().map(|(_, header)| cells(header));
        let mut table = Self {
            names: names.unwrap_or_default(),
            values: Vec::new(),
        };
        for (k, name) in table.names.iter().enumerate() {
            if !known.contains(&name.as_str()) {
                let all = known.join(", ");
                return Err(format!("line 1: unknown column `{name}` (known: {all})"));
            }
            if table.names[..k].contains(name) {
                return Err(format!("line 1: the column `{name}` is there twice"));
            }
        }
        for (k, line) in lines.filter(|(_, line)| !line.trim().is_empty()) {
            let cells = cells(line);
            if cells.len() != table.names.len() {
                let (found, wanted) = (cells.len(), table.names.len());
                return Err(format!(
                    "line {}: {found} numbers for {wanted} columns",
                    k + 1
                ));
            }
            for cell in cells {
                let number = cell.parse().ok().filter(|v: &f64| v.is_finite());
                let refused = || format!("line {}: `{cell}` is not a finite number", k + 1);
                table.values.push(number.ok_or_else(refused)?);
            }
        }
        if table.values.is_empty() {
            return Err("it holds no numbers".to_owned());
        }
        Ok(table)
    }

    /// The numbers of a column, if there is one of that name.
    pub fn column(&self, name: &str) -> Option<Vec<f64>> {
        let index = self.names.iter().position(|n| n == name)?;
        let lines = self.values.chunks_exact(self.names.len());
        Some(lines.map(|line| line[index]).collect())
    }

    /// Number of lines.
    pub fn len(&self) -> usize {
        self.values.len() / self.names.len().max(1)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str) -> Result<Csv, String> {
        let folder = tempfile::tempdir().expect("folder");
        let path = folder.path().join("table.csv");
        std::fs::write(&path, text).expect("written");
        Csv::read(&path, &["time", "value"])
    }

    #[test]
    fn columns_are_found_by_name() {
        let table = read("value, time\n1,0\n\n-2.5e0, 1\r\n").expect("table");
        assert_eq!(table.column("time"), Some(vec![0.0, 1.0]));
        assert_eq!(table.column("value"), Some(vec![1.0, -2.5]));
        assert_eq!((table.column("x"), table.len()), (None, 2));
    }

    #[test]
    fn complaints_name_the_line() {
        let complaint = |text: &str| read(text).expect_err(text);
        assert!(complaint("time,velue\n").contains("line 1: unknown column `velue`"));
        assert!(complaint("time,time\n").contains("twice"));
        assert!(complaint("time,value\n1,2\n3\n").contains("line 3: 1 numbers for 2"));
        assert!(complaint("time,value\n1,inf\n").contains("line 2: `inf`"));
        assert!(complaint("time,value\n").contains("no numbers"));
    }
}
