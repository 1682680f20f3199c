//! What is wrong with a case file, and where.

use miette::{GraphicalReportHandler, GraphicalTheme, NamedSource, SourceSpan};

/// A complaint about the case: what, where (file, line, column) and what would be valid.
#[derive(Debug, thiserror::Error, miette::Diagnostic)]
#[error("{message}")]
pub struct CaseError {
    message: String,
    #[source_code]
    source_text: NamedSource<String>,
    #[label("here")]
    span: Option<SourceSpan>,
    #[help]
    help: Option<String>,
}

impl CaseError {
    /// A complaint about `span` of a named text.
    pub fn new(
        message: impl Into<String>,
        name: &str,
        text: &str,
        span: Option<std::ops::Range<usize>>,
    ) -> Box<Self> {
        Box::new(Self {
            message: message.into(),
            source_text: NamedSource::new(name, text.to_owned()),
            span: span.map(SourceSpan::from),
            help: None,
        })
    }

    /// Adds what would be valid.
    #[must_use]
    pub fn with_help(mut self: Box<Self>, help: impl Into<String>) -> Box<Self> {
        self.help = Some(help.into());
        self
    }

    /// The paragraph that is shown: message, excerpt with line numbers, help.
    pub fn render(&self) -> String {
        let mut text = String::new();
        let handler = GraphicalReportHandler::new_themed(GraphicalTheme::unicode_nocolor())
            .with_width(100)
            .with_context_lines(1);
        match handler.render_report(&mut text, self) {
            Ok(()) => text,
            Err(_) => self.message.clone(),
        }
    }
}
