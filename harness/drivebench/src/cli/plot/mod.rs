//! `drivebench plot`: recorded values of one or several files over the same times, and what tells their steps apart.

pub(crate) mod read;
mod step;

use crate::command::exit::Exit;
use crate::command::failure::Failure;
use crate::command::file;
use crate::command::output::Output;
use crate::html::Html;
use crate::report::chart::{Chart, Curve, MAX_CURVES, number};
use clap::{Args, ValueEnum};
use read::{Recording, read};
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use step::{Settled, StepFigures};

/// The columns of the table, and what each means.
const COLUMNS: [(&str, &str); 7] = [
    ("curve", ""),
    ("least", "the smallest sample"),
    ("most", "the largest sample"),
    (
        "final",
        "the mean of the samples in the last tenth of the recording's time",
    ),
    (
        "step",
        "the final value less the first sample; left out where it is less than a tenth of what lies between least and most",
    ),
    (
        "overshoot",
        "how far a sample lies beyond the final value, in percent of the step",
    ),
    (
        "settling",
        "from the last sample near the first value up to the first one from which on all stay near the final value; \
         near is within 5 % of the step; not settled: it would have settled in the last tenth",
    ),
];

/// For `plot`.
#[derive(Clone, Debug, Args)]
pub struct PlotArguments {
    /// The recordings: files of `watch --csv` or `scope --csv`, or of `trace --format json` with the records of a scenario.
    #[arg(value_name = "FILE", required = true, num_args = 1..=16)]
    pub files: Vec<PathBuf>,
    /// Draw them into this file: .html is a page with a cursor, .svg a picture.
    #[arg(long, short, value_name = "FILE")]
    pub output: Option<PathBuf>,
    /// What is at time 0.
    #[arg(long, value_enum, default_value_t = PlotAlignment::First)]
    pub align: PlotAlignment,
    /// Only curves with this text in their name, such as nist.
    #[arg(long, value_name = "TEXT")]
    pub only: Vec<String>,
}

/// What is at time 0 where recordings are compared.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, ValueEnum)]
pub enum PlotAlignment {
    /// The first sample of each recording.
    #[default]
    First,
    /// The trigger of each recording of `scope`.
    Trigger,
}

/// Draws recordings into a file, and prints what tells them apart.
pub(crate) fn plot(arguments: &PlotArguments, output: &mut Output) -> std::io::Result<Exit> {
    match draw(arguments) {
        Ok(table) => {
            output.result(&table)?;
            Ok(Exit::Passed)
        }
        Err(failure) => Ok(failure.tell(output)),
    }
}

/// The form of the file that the curves are drawn into.
enum Form {
    Page,
    Picture,
}

fn form(path: &Path) -> Result<Form, Failure> {
    let ending = path.extension().and_then(|ending| ending.to_str());
    match ending.map(str::to_ascii_lowercase).as_deref() {
        Some("html" | "htm") => Ok(Form::Page),
        Some("svg") => Ok(Form::Picture),
        _ => Err(Failure::refused(format!(
            "--output {}: the name must end in .html for a page with a cursor, or in .svg for a picture",
            path.display()
        ))),
    }
}

fn draw(arguments: &PlotArguments) -> Result<String, Failure> {
    let target = match &arguments.output {
        None => None,
        Some(path) => {
            file::check(path)?;
            Some((path, form(path)?))
        }
    };
    let mut recordings = Vec::new();
    for path in &arguments.files {
        let mut recording = read(path).map_err(|error| Failure::refused(error.to_string()))?;
        if !arguments.only.is_empty() {
            let named = |name: &str| arguments.only.iter().any(|word| name.contains(word));
            recording.curves.retain(|curve| named(&curve.name));
        }
        align(&mut recording, path, arguments.align)?;
        recordings.push(recording);
    }
    let names = names(&arguments.files);
    let mut curves = Vec::new();
    for (place, (recording, name)) in recordings.into_iter().zip(&names).enumerate() {
        curves.extend(recording.curves.into_iter().map(|curve| Curve {
            name: format!("{name}: {}", curve.name),
            dash: place,
            ..curve
        }));
    }
    if curves.is_empty() {
        return Err(Failure::refused(format!(
            "no curve has {} in its name",
            arguments.only.join(" or ")
        )));
    }
    let rows: Vec<_> = curves.iter().map(row).collect();
    if let Some((path, form)) = target {
        let chart = Chart {
            id: "plot",
            title: &names.join(", "),
            note: match arguments.align {
                PlotAlignment::First => "Time 0 is the first sample of each recording.",
                PlotAlignment::Trigger => "Time 0 is the trigger of each recording.",
            },
            curves: &curves,
            ..Chart::default()
        };
        let text = match form {
            Form::Picture => chart.picture(),
            Form::Page => chart.page(&table(&rows)),
        };
        file::write(path, &text)?;
    }
    Ok(text(&rows))
}

/// Moves a recording to where it is compared.
fn align(recording: &mut Recording, path: &Path, align: PlotAlignment) -> Result<(), Failure> {
    let all = recording.curves.iter().flat_map(|curve| &curve.points);
    let first = all.map(|point| point.0).min_by(f64::total_cmp);
    match align {
        PlotAlignment::Trigger if recording.triggered => {}
        PlotAlignment::Trigger => {
            return Err(Failure::refused(format!(
                "{}: --align trigger is for recordings of `scope` whose trigger is not their first sample, and this one has none; use --align first",
                path.display()
            )));
        }
        PlotAlignment::First => {
            let curves = recording.curves.iter_mut();
            let points = curves.flat_map(|curve| &mut curve.points);
            points.for_each(|point| point.0 -= first.unwrap_or(0.0));
        }
    }
    Ok(())
}

/// Short names of the files: without folder and ending, unless two would be alike.
fn names(files: &[std::path::PathBuf]) -> Vec<String> {
    let short = |path: &Path| {
        path.file_stem()
            .map(|stem| stem.to_string_lossy().into_owned())
    };
    let all: Vec<_> = files.iter().filter_map(|path| short(path)).collect();
    let different: BTreeSet<_> = all.iter().collect();
    match different.len() == files.len() {
        true => all,
        false => files
            .iter()
            .map(|file| file.display().to_string())
            .collect(),
    }
}

/// The fields of a curve in the table; "-" where there is no figure.
fn row(curve: &Curve) -> [String; 7] {
    let unit = curve.unit.as_str();
    let value = |value: Option<f64>| match value {
        None => "-".to_owned(),
        Some(value) => format!("{} {unit}", number(value, unit))
            .trim_end()
            .to_owned(),
    };
    let known = || curve.known().map(|point| point.1);
    let figures = StepFigures::of(curve);
    let figures = figures.as_ref();
    [
        curve.name.clone(),
        value(known().min_by(f64::total_cmp)),
        value(known().max_by(f64::total_cmp)),
        value(figures.map(|figures| figures.last)),
        value(figures.and_then(|figures| figures.step)),
        figures
            .and_then(|figures| figures.overshoot)
            .map_or("-".to_owned(), |percent| format!("{percent:.1} %")),
        match figures.and_then(|figures| figures.settled) {
            None => "-".to_owned(),
            Some(Settled::Never) => "not settled".to_owned(),
            Some(Settled::After(ms)) => format!("{} ms", number(ms, "ms")),
        },
    ]
}

fn text(rows: &[[String; 7]]) -> String {
    let heads = COLUMNS.map(|column| column.0.to_owned());
    let all = || std::iter::once(&heads).chain(rows);
    let widths: [usize; 7] = std::array::from_fn(|column| {
        let widths = all().map(|row| row[column].chars().count());
        widths.max().unwrap_or(0)
    });
    let mut text = String::new();
    for row in all() {
        let fields = row.iter().zip(widths).enumerate();
        let padded = fields.map(|(column, (field, width))| match column {
            0 => format!("{field:width$}"),
            _ => format!("{field:>width$}"),
        });
        text.push_str(padded.collect::<Vec<_>>().join("  ").trim_end());
        text.push('\n');
    }
    if rows.len() > MAX_CURVES {
        text.push_str(&format!(
            "A picture shows the first {MAX_CURVES} curves; choose some with --only.\n"
        ));
    }
    text
}

fn table(rows: &[[String; 7]]) -> Html {
    let mut html = Html::new();
    html.element("table", &[], |html| {
        html.line("caption", &[], "Figures of the curves");
        html.heads(&COLUMNS.map(|column| column.0));
        for row in rows {
            html.element("tr", &[], |html| {
                for field in row {
                    html.line("td", &[("class", &"n")], field);
                }
            });
        }
    });
    html.element("dl", &[], |html| {
        for (name, meaning) in &COLUMNS[1..] {
            html.line("dt", &[], *name);
            html.line("dd", &[], *meaning);
        }
    });
    html
}
