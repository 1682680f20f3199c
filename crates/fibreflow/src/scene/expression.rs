//! Formulas in x, y, z or t, as they stand in a case file.

/// A formula, ready to be evaluated.
#[derive(Clone, Debug)]
pub struct Expression {
    root: Node,
}

#[derive(Clone, Debug)]
enum Node {
    Number(f64),
    Variable(usize),
    Negative(Box<Node>),
    Binary(char, Box<Node>, Box<Node>),
    Call(Function, Box<Node>),
}

type Function = fn(f64) -> f64;

const FUNCTIONS: [(&str, Function); 10] = [
    ("sin", f64::sin),
    ("cos", f64::cos),
    ("tan", f64::tan),
    ("sinh", f64::sinh),
    ("cosh", f64::cosh),
    ("tanh", f64::tanh),
    ("exp", f64::exp),
    ("log", f64::ln),
    ("sqrt", f64::sqrt),
    ("abs", f64::abs),
];

impl Expression {
    /// Reads a formula in some variables; `^` binds tightest and to the right, then the sign, then `* /`, then `+ −`.
    ///
    /// # Errors
    /// What was expected, and at which character.
    pub fn parse(text: &str, variables: &[&str]) -> Result<Self, String> {
        let mut parser = Parser {
            rest: text,
            text,
            variables,
        };
        let root = parser.sum()?;
        match parser.peek() {
            None => Ok(Self { root }),
            Some(c) => Err(parser.complaint(&format!("unexpected `{c}`"))),
        }
    }

    /// Value, from those of the variables in the order in which they were named.
    pub fn at(&self, values: &[f64]) -> f64 {
        self.root.at(values)
    }

    /// True when the value depends on a variable.
    pub fn uses(&self, variable: usize) -> bool {
        self.root.uses(variable)
    }
}

impl Node {
    fn at(&self, x: &[f64]) -> f64 {
        match self {
            Self::Number(value) => *value,
            Self::Variable(index) => x[*index],
            Self::Negative(inner) => -inner.at(x),
            Self::Call(function, inner) => function(inner.at(x)),
            Self::Binary(operator, left, right) => {
                let (a, b) = (left.at(x), right.at(x));
                match operator {
                    '+' => a + b,
                    '-' => a - b,
                    '*' => a * b,
                    '/' => a / b,
                    _ => a.powf(b),
                }
            }
        }
    }

    fn uses(&self, variable: usize) -> bool {
        match self {
            Self::Number(_) => false,
            Self::Variable(index) => *index == variable,
            Self::Negative(inner) | Self::Call(_, inner) => inner.uses(variable),
            Self::Binary(_, left, right) => left.uses(variable) || right.uses(variable),
        }
    }
}

struct Parser<'a> {
    rest: &'a str,
    text: &'a str,
    variables: &'a [&'a str],
}

impl Parser<'_> {
    fn peek(&mut self) -> Option<char> {
        self.rest = self.rest.trim_start();
        self.rest.chars().next()
    }

    fn take(&mut self, wanted: &[char]) -> Option<char> {
        let found = self.peek().filter(|c| wanted.contains(c))?;
        self.rest = &self.rest[found.len_utf8()..];
        Some(found)
    }

    fn complaint(&self, what: &str) -> String {
        let at = self.text.len() - self.rest.len() + 1;
        format!("{what} at character {at} of `{}`", self.text)
    }

    fn sum(&mut self) -> Result<Node, String> {
        let mut left = self.product()?;
        while let Some(operator) = self.take(&['+', '-']) {
            left = Node::Binary(operator, Box::new(left), Box::new(self.product()?));
        }
        Ok(left)
    }

    fn product(&mut self) -> Result<Node, String> {
        let mut left = self.signed()?;
        while let Some(operator) = self.take(&['*', '/']) {
            left = Node::Binary(operator, Box::new(left), Box::new(self.signed()?));
        }
        Ok(left)
    }

    fn signed(&mut self) -> Result<Node, String> {
        match self.take(&['+', '-']) {
            Some('-') => Ok(Node::Negative(Box::new(self.signed()?))),
            Some(_) => self.signed(),
            None => self.power(),
        }
    }

    fn power(&mut self) -> Result<Node, String> {
        let base = self.atom()?;
        match self.take(&['^']) {
            Some(_) => Ok(Node::Binary('^', Box::new(base), Box::new(self.signed()?))),
            None => Ok(base),
        }
    }

    fn atom(&mut self) -> Result<Node, String> {
        match self.peek() {
            Some('(') => self.bracket(),
            Some(c) if c.is_ascii_digit() || c == '.' => self.number(),
            Some(c) if c.is_ascii_alphabetic() => self.name(),
            _ => Err(self.complaint("a number, name or bracket is missing")),
        }
    }

    fn bracket(&mut self) -> Result<Node, String> {
        if self.take(&['(']).is_none() {
            return Err(self.complaint("`(` is missing"));
        }
        let inner = self.sum()?;
        match self.take(&[')']) {
            Some(_) => Ok(inner),
            None => Err(self.complaint("`)` is missing")),
        }
    }

    fn number(&mut self) -> Result<Node, String> {
        let bytes = self.rest.as_bytes();
        let mut end = 0;
        while let Some(&b) = bytes.get(end) {
            let exponent_sign =
                matches!(b, b'+' | b'-') && end > 0 && matches!(bytes[end - 1], b'e' | b'E');
            if !(b.is_ascii_digit() || matches!(b, b'.' | b'e' | b'E') || exponent_sign) {
                break;
            }
            end += 1;
        }
        let value = self.rest[..end]
            .parse()
            .map_err(|_| self.complaint("not a number"))?;
        self.rest = &self.rest[end..];
        Ok(Node::Number(value))
    }

    fn name(&mut self) -> Result<Node, String> {
        let end = self
            .rest
            .find(|c: char| !c.is_ascii_alphanumeric())
            .unwrap_or(self.rest.len());
        let (name, rest) = self.rest.split_at(end);
        let variable = self.variables.iter().position(|v| *v == name);
        let node = match (variable, FUNCTIONS.iter().find(|f| f.0 == name)) {
            (Some(index), _) => Node::Variable(index),
            (None, _) if name == "pi" => Node::Number(std::f64::consts::PI),
            (None, Some((_, function))) => {
                self.rest = rest;
                return Ok(Node::Call(*function, Box::new(self.bracket()?)));
            }
            (None, None) => {
                let known = [self.variables, &["pi"]].concat();
                let functions = FUNCTIONS.iter().map(|f| f.0);
                let all: Vec<&str> = known.into_iter().chain(functions).collect();
                let unknown = format!("unknown name `{name}` (known: {})", all.join(", "));
                return Err(self.complaint(&unknown));
            }
        };
        self.rest = rest;
        Ok(node)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn formulas_follow_the_usual_order() {
        let at = |text: &str| {
            let formula = Expression::parse(text, &["x", "y", "z"]).expect(text);
            formula.at(&[2.0, 3.0, 0.5])
        };
        assert_eq!(at("1 + x * y ^ 2"), 19.0);
        assert_eq!(at("-x^2"), -4.0);
        assert_eq!(at("2^-1"), 0.5);
        assert_eq!(at("2^3^2"), 512.0);
        assert_eq!(at("8 / 4 / 2 - 1 - 1"), -1.0);
        assert_eq!(at("1.5e-1*(x+y)"), 0.75);
        assert!((at("sin(pi*z) + cos(0) - sqrt(x*2)")).abs() < 1e-15);
    }

    #[test]
    fn complaints_say_where() {
        let complaint = |text: &str| Expression::parse(text, &["x", "y"]).expect_err(text);
        assert!(complaint("1 + ").contains("character 5"));
        assert!(complaint("foo(x)").contains("unknown name `foo`"));
        assert!(complaint("(x").contains("`)` is missing"));
        assert!(complaint("x y").contains("unexpected `y` at character 3"));
        let unknown = complaint("2*t");
        assert!(unknown.contains("`t` (known: x, y, pi, sin"), "{unknown}");
    }

    #[test]
    fn a_formula_knows_what_it_depends_on() {
        let formula = Expression::parse("1 - cos(2*t) + y*0", &["x", "y", "t"]).expect("formula");
        assert_eq!([0, 1, 2].map(|v| formula.uses(v)), [false, true, true]);
    }
}
