//! `quest-cli simulate`: the experiments of section 9.

mod boxes;
mod curves;
mod pairs;
mod record;
mod run;
mod statistics;
mod summary;
mod timing;

use clap::{Args, ValueEnum};
use quest_core::{
    simulate::{Boxes, Figure, Layout, Motion, SceneOptions},
    solver::{Kinds, SolverName},
};

use self::{pairs::Planted, record::Record, run::Run};
use crate::{
    Failure, Outcome,
    options::{Format, OutputOptions, kinds_parser, solver_parser},
    plot::{Plot, parse_plot},
    progress::ProgressOptions,
    rows,
};

const EXAMPLES: &str = "\
Examples:
  quest-cli simulate                                  the whole paper, at its own numbers of trials
  quest-cli simulate --figure 4 --trials 1000 -o figure4.csv --plot figure4.html
  quest-cli simulate --figure 6 --solvers quest,nister --scenes realistic
  quest-cli simulate --table 1
  quest-cli simulate --figure 4 --points-box -1,1,-1,1,5,7 --translation-box 1,1,0.2
  quest-cli simulate --pairs 100 --noise 0.75 -o scenes.jsonl && quest-cli solve scenes.jsonl
  quest-cli simulate --pairs 1 --scenes realistic --points 200 --noise 0.5 --outliers 0.3 -o pair.json
  quest-cli estimate pair.json

Figures:
  4 noise, general points        5 noise, coplanar points      6 parallax
  7 rotation alone               8 translation alone
  Errors are the paper's metrics in radians: half the angle of the rotation (61), and the angle
  between the translations whatever their signs (62).

Readings (compare solvers only within one of them):
  exact     the real solution closest to the truth
  all       the candidate of any kind closest to the truth: also real parts of complex
            solutions, and the rotation alone
  selected  the candidate that 30 further points of the scene choose, without the truth

--pairs writes scenes instead of solving them: JSON Lines, of one pair also JSON, that `solve`,
`estimate` and `view` read: pixels, the camera of (60) and the true pose, whose |t| is the parallax (63).

The same seed gives the same numbers on any number of threads. The times of table 1 are
measured on one thread. ± is the 95 % confidence interval of the mean. \"ahead of\" counts the
values at which a solver has smaller errors than the first solver at the same scenes: the 95 %
confidence interval of the mean difference is below zero.";

/// Options that `--pairs`, and those that belong to it, would ignore. clap does not ask for `--pairs` beside one of them.
const OF_EXPERIMENTS: [&str; 8] =
    ["figure", "table", "plot", "trials", "solvers", "kinds", "threads", "progress"];

/// The experiments of the paper's section 9: errors of the solvers on random scenes, and their times.
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Arguments {
    /// Run only this figure of the paper. The option may be repeated.
    #[arg(long, value_name = "4..8", value_parser = parse_figure)]
    figure: Vec<Figure>,
    /// Run only this table of the paper.
    #[arg(long, value_name = "1", value_parser = clap::value_parser!(u8).range(1..=1))]
    table: Option<u8>,
    /// Number of scenes for each value of the noise or the parallax, and for the table [default: as in the paper].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000_000))]
    trials: Option<u32>,
    /// The solvers to compare, separated by commas [default: all for which the points suffice].
    #[arg(long, value_name = "NAMES", value_delimiter = ',', value_parser = solver_parser())]
    solvers: Vec<SolverName>,
    /// Which candidates the readings `all` and `selected` choose from.
    #[arg(long, value_name = "all|planar", default_value = Kinds::default().name(), value_parser = kinds_parser())]
    kinds: Kinds,
    /// The seed of the scenes.
    #[arg(long, value_name = "S", default_value_t = 2018)]
    seed: u64,
    /// How scenes are drawn.
    #[arg(long, value_enum, default_value_t = Scenes::Paper)]
    scenes: Scenes,
    /// Number of points of a scene.
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u16).range(5..=1000))]
    points: u16,
    /// The box of the points in the frame of camera 1; the paper does not give its size.
    #[arg(long, value_name = "x0,x1,y0,y1,z0,z1", value_parser = boxes::points, allow_hyphen_values = true,
        default_value = boxes::POINTS)]
    points_box: [[f64; 2]; 3],
    /// The largest absolute x, y and z of a translation.
    #[arg(long, value_name = "x,y,z", value_parser = boxes::translation, default_value = boxes::TRANSLATION)]
    translation_box: [f64; 3],
    /// Write this many scenes as pairs, and run nothing.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..=100_000_000),
        conflicts_with_all = OF_EXPERIMENTS)]
    pairs: Option<u32>,
    /// Standard deviation of the noise of these pairs, in pixels of the camera (60).
    #[arg(long, value_name = "PX", default_value_t = 0.0, requires = "pairs",
        conflicts_with_all = OF_EXPERIMENTS)]
    noise: f64,
    /// The share of these pairs' matches whose point in view 2 is anywhere in the image instead.
    #[arg(long, value_name = "SHARE", default_value_t = 0.0, requires = "pairs", value_parser = pairs::parse_share,
        allow_negative_numbers = true, conflicts_with_all = OF_EXPERIMENTS)]
    outliers: f64,
    /// The parallax of these pairs, from 0 (a rotation alone) to 1 [default: that of a random motion].
    #[arg(long, value_name = "P", requires = "pairs", allow_negative_numbers = true, conflicts_with_all = OF_EXPERIMENTS)]
    parallax: Option<f64>,
    /// Put the points of these pairs on a plane.
    #[arg(long, requires = "pairs", conflicts_with_all = OF_EXPERIMENTS)]
    coplanar: bool,
    /// Round pixels to whole numbers after the noise. Table 1 always does, as in the paper.
    #[arg(long)]
    rounded: bool,
    /// Draw the figures into this file: .svg, .html for a page that works offline, or .png and .pdf (where the tool was built with the
    /// feature `figures`).
    #[arg(long, value_name = "FILE.svg|html|png|pdf", value_parser = parse_plot)]
    plot: Option<Plot>,
    /// Number of threads; 0 takes as many as there are cores.
    #[arg(long, value_name = "N", default_value_t = 0)]
    threads: usize,
    #[command(flatten)]
    progress: ProgressOptions,
    #[command(flatten)]
    output: OutputOptions,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
enum Scenes {
    /// Rotations up to 360°, points also behind camera 2 or outside the image, as in the paper.
    Paper,
    /// Rotations up to 30°, all points in front of both cameras and inside both images.
    Realistic,
}

fn parse_figure(text: &str) -> Result<Figure, String> {
    let found = Figure::ALL.into_iter().find(|figure| figure.number().to_string() == text);
    found.ok_or_else(|| "expected 4, 5, 6, 7 or 8".to_owned())
}

pub(crate) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let format = arguments.output.format(Format::Table);
    let mut output = arguments.output.open()?;
    if let Some(count) = arguments.pairs {
        let planted = Planted {
            scenes: arguments.planted(),
            outliers: arguments.outliers,
            seed: arguments.seed,
            count,
        };
        pairs::write(&mut output, &planted, arguments.output.format(Format::Jsonl))?;
        output.finish()?;
        return Ok(Outcome::Answer);
    }
    let plot = match &arguments.plot {
        Some(plot) => Some((plot, plot.open()?)),
        None => None,
    };
    let run = arguments.plan()?;
    if plot.is_some() && run.figures.is_empty() {
        return Err(Failure::Arguments(
            "found --plot and --table alone, expected a --figure to draw".to_owned(),
        ));
    }
    let records = run.execute()?;
    output.write(|w| match format {
        Format::Table => write!(w, "{}", summary::text(&run, &records)),
        Format::Json => quest_io::write_json(w, &records),
        Format::Jsonl => records.iter().try_for_each(|record| rows::write_line(w, record)),
        Format::Csv => rows::write_csv(w, &records),
    })?;
    if let Some((plot, file)) = plot {
        plot.write(file, curves::drawn(&run, &records, plot.is_svg())?)?;
    }
    output.finish()?;
    Ok(Outcome::Answer)
}

impl Arguments {
    /// The scenes, before a figure changes what it varies.
    fn base(&self) -> SceneOptions {
        let base = match self.scenes {
            Scenes::Paper => SceneOptions::default(),
            Scenes::Realistic => SceneOptions::realistic(),
        };
        let boxes = Boxes { points: self.points_box, translation: self.translation_box };
        SceneOptions { points: usize::from(self.points), rounded: self.rounded, boxes, ..base }
    }

    /// The scenes of pairs.
    fn planted(&self) -> SceneOptions {
        let base = self.base();
        SceneOptions {
            noise_px: self.noise,
            motion: self.parallax.map_or(base.motion, Motion::Parallax),
            layout: if self.coplanar { Layout::Coplanar } else { base.layout },
            ..base
        }
    }

    fn plan(&self) -> Result<Run, Failure> {
        let is_whole = self.figure.is_empty() && self.table.is_none();
        let mut figures = if is_whole { Figure::ALL.to_vec() } else { self.figure.clone() };
        figures.sort_by_key(|figure| figure.number());
        figures.dedup();
        let points = usize::from(self.points);
        if let Some(solver) = self.solvers.iter().find(|s| s.info().min_matches > points) {
            let (name, needed) = (solver.info().name, solver.info().min_matches);
            return Err(Failure::Arguments(format!(
                "--solvers: {name} needs {needed} points, the scenes have {points}; --points {needed} gives them more"
            )));
        }
        Ok(Run {
            figures,
            has_table: is_whole || self.table.is_some(),
            trials: self.trials,
            solvers: self.solvers.clone(),
            kinds: self.kinds,
            seed: self.seed,
            scenes: match self.scenes {
                Scenes::Paper => "paper",
                Scenes::Realistic => "realistic",
            },
            base: self.base(),
            threads: self.threads,
            progress: self.progress,
            is_quiet: self.output.quiet,
        })
    }
}
