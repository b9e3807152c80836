//! What is wrong with a file: severity, place, what was expected and how to mend it.
//!
//! Diagnostics are collected, so that one reading tells every error of a file. Each holds its source text, so that
//! diagnostics of several files can be shown together.

use annotate_snippets::renderer::DecorStyle;
use annotate_snippets::{AnnotationKind, Group, Level, Renderer, Snippet};
use std::fmt;
use std::ops::Range;
use std::sync::Arc;

/// How grave a diagnostic is; only errors keep a plan from running.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Severity {
    Notice,
    Warning,
    Error,
}

/// The text of a file with the name by which the user knows it.
#[derive(Debug, Default, PartialEq, Eq)]
pub struct Source {
    pub name: String,
    pub text: String,
}

/// Bytes of a source text that a diagnostic underlines.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Place {
    pub source: Arc<Source>,
    pub span: Range<usize>,
}

impl Place {
    /// 1-based line of the first underlined byte.
    pub fn line(&self) -> usize {
        1 + self.before().matches('\n').count()
    }

    /// 1-based column of the first underlined character, counted in characters.
    pub fn column(&self) -> usize {
        1 + self
            .before()
            .chars()
            .rev()
            .take_while(|&character| character != '\n')
            .count()
    }

    fn before(&self) -> &str {
        let end = self.span.start.min(self.source.text.len());
        self.source.text.get(..end).unwrap_or("")
    }
}

/// One thing to tell about a file.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Diagnostic {
    pub severity: Severity,
    /// Lowercase, without full stop: `unknown energy "strech"`.
    pub message: String,
    pub place: Option<Place>,
    /// Stands beside the underline: what was expected there.
    pub label: String,
    /// The mend: `did you mean "stretch"?`
    pub help: Option<String>,
}

impl Diagnostic {
    /// An error without a place.
    pub fn error(message: impl Into<String>) -> Self {
        Diagnostic {
            severity: Severity::Error,
            message: message.into(),
            place: None,
            label: String::new(),
            help: None,
        }
    }

    /// A warning without a place.
    pub fn warning(message: impl Into<String>) -> Self {
        Diagnostic {
            severity: Severity::Warning,
            ..Diagnostic::error(message)
        }
    }

    /// Underlines these bytes.
    pub fn at(mut self, source: &Arc<Source>, span: Range<usize>) -> Self {
        self.place = Some(Place {
            source: source.clone(),
            span,
        });
        self
    }

    /// Says beside the underline what was expected.
    pub fn label(mut self, label: impl Into<String>) -> Self {
        self.label = label.into();
        self
    }

    /// Says how to mend it.
    pub fn help(mut self, help: impl Into<String>) -> Self {
        self.help = Some(help.into());
        self
    }

    /// The same where there may be nothing to say.
    pub fn help_if(mut self, help: Option<String>) -> Self {
        self.help = help.or(self.help);
        self
    }
}

/// One line: `file.toml:3:10: error: unknown energy "strech" (did you mean "stretch"?)`.
impl fmt::Display for Diagnostic {
    fn fmt(&self, formatter: &mut fmt::Formatter<'_>) -> fmt::Result {
        if let Some(place) = &self.place {
            write!(formatter, "{}:{}:{}: ", place.source.name, place.line(), place.column())?;
        }
        let severity = match self.severity {
            Severity::Error => "error",
            Severity::Warning => "warning",
            Severity::Notice => "notice",
        };
        write!(formatter, "{severity}: {}", self.message)?;
        if !self.label.is_empty() {
            write!(formatter, ": {}", self.label)?;
        }
        match &self.help {
            Some(help) => write!(formatter, " ({help})"),
            None => Ok(()),
        }
    }
}

/// Diagnostics as a person reads them, each with its lines of the file underlined; `colour` for a terminal.
pub fn render(diagnostics: &[Diagnostic], colour: bool) -> String {
    let renderer = if colour { Renderer::styled() } else { Renderer::plain() };
    let renderer = renderer.decor_style(DecorStyle::Ascii);
    let mut text = String::new();
    for diagnostic in diagnostics {
        let level = match diagnostic.severity {
            Severity::Error => Level::ERROR,
            Severity::Warning => Level::WARNING,
            Severity::Notice => Level::NOTE.with_name("notice"),
        };
        let group = match &diagnostic.place {
            Some(place) => {
                let mut annotation = AnnotationKind::Primary.span(visible(place));
                if !diagnostic.label.is_empty() {
                    annotation = annotation.label(diagnostic.label.as_str());
                }
                let snippet = Snippet::source(place.source.text.as_str())
                    .path(place.source.name.as_str())
                    .annotation(annotation);
                let group = level.primary_title(diagnostic.message.as_str()).element(snippet);
                match &diagnostic.help {
                    Some(help) => group.element(Level::HELP.message(help.as_str())),
                    None => group,
                }
            }
            None => Group::with_title(level.primary_title(diagnostic.message.as_str())),
        };
        text.push_str(&renderer.render(&[group]));
        text.push('\n');
        if let (None, Some(help)) = (&diagnostic.place, &diagnostic.help) {
            text.push_str(&format!("help: {help}\n"));
        }
        text.push('\n');
    }
    text
}

/// The underlined bytes within their first line, and at least one wide: long lists stay readable.
fn visible(place: &Place) -> Range<usize> {
    let text = &place.source.text;
    let start = place.span.start.min(text.len());
    let end = place.span.end.clamp(start, text.len());
    match text.get(start..end) {
        Some(part) => start..start + part.find('\n').unwrap_or(part.len()),
        None => start..start,
    }
}
