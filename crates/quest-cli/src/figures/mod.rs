//! `quest-cli figures`: figures B.20 to B.22 of the paper, of its example or of any pair: why theorem 2 rejects a candidate.

mod page;
mod scene;
mod sphere;

use std::path::PathBuf;

use clap::Args;
use quest_core::{
    Candidate, Candidates, Correspondence,
    feasibility::{Verdict, verdict},
    solver::{Kinds, PoseSolver, Quest},
};

use crate::{
    Failure, Outcome,
    plot::{Plot, parse_plot},
    solve,
};

const EXAMPLES: &str = "\
Without a file the figures show the scene of appendix B: camera 2 at (-800, 600, -500) mm, turned by 35
degrees; the five points are ours, the paper does not give them.

Figures 9, 10 and 12 to 19 are drawn by quest-cli servo --plot, 4 to 8 by quest-cli simulate --plot.

Examples:
  quest-cli figures -o appendix-b.html        to turn and zoom, in one file that works offline
  quest-cli figures -o appendix-b.svg
  quest-cli figures pair.json -o spheres.html";

/// Figures B.20 to B.22: image points on unit spheres, and how translation moves them.
#[derive(Args, Debug)]
#[command(after_help = EXAMPLES)]
pub(crate) struct Arguments {
    /// A pair of five or more correct matches, as for `solve`; the paper's example if it is absent.
    file: Option<PathBuf>,
    /// Draw into this file: .svg, .html for a page that works offline, or .png and .pdf (where the tool was built with the
    /// feature `figures`).
    #[arg(short, long, value_name = "FILE.svg|html|png|pdf", value_parser = parse_plot)]
    output: Plot,
}

/// A candidate and what theorem 2 says of it.
#[derive(Clone, Copy, Debug)]
struct Judged {
    /// Its place among the candidates, from one.
    number: usize,
    candidate: Candidate,
    verdict: Verdict,
}

/// What is drawn.
struct Drawn {
    title: String,
    matches: Vec<Correspondence>,
    all: Vec<Judged>,
    /// One that looks back at the points, one whose points move the wrong way, one that is feasible; those that there are.
    shown: Vec<Judged>,
}

pub(crate) fn run(arguments: &Arguments) -> Result<Outcome, Failure> {
    let output = arguments.output.open()?;
    let (title, matches) = match &arguments.file {
        None => ("Appendix B: which candidates are feasible".to_owned(), scene::of_the_paper()),
        Some(file) => {
            let pairs = quest_io::read(file, None)?.next().transpose()?;
            let Some(pair) = pairs else {
                return Err(Failure::Arguments(format!("{}: found no pair, expected one", file.display())));
            };
            (pair.place.to_string(), solve::enough_matches(&pair, quest_core::solver::SolverName::Quest)?)
        }
    };
    let drawn = Drawn::new(title, matches)?;
    let text = if arguments.output.is_svg() { page::svg(&drawn)? } else { page::html(&drawn)? };
    arguments.output.write(output, text)?;
    Ok(Outcome::Answer)
}

impl Drawn {
    fn new(title: String, matches: Vec<Correspondence>) -> Result<Self, Failure> {
        let mut found = Candidates::new();
        Quest { kinds: Kinds::Exact }.solve(&matches, &mut found);
        let judged = found.iter().enumerate().map(|(k, candidate)| Judged {
            number: k + 1,
            candidate: *candidate,
            verdict: verdict(&candidate.pose, &matches),
        });
        let all: Vec<_> = judged.filter(|j| j.candidate.pose.t_21.norm() > 0.0).collect();
        let with = |is: fn(&Verdict) -> bool| all.iter().find(|j| is(&j.verdict)).copied();
        let shown: Vec<_> = [
            with(|v| !v.is_ahead),
            with(|v| v.is_ahead && !(v.turns_away && v.stays_on_its_side)),
            with(Verdict::is_feasible),
        ]
        .into_iter()
        .flatten()
        .collect();
        if shown.is_empty() {
            let why = found.degeneracy().map_or_else(|| "no real solution".to_owned(), |d| d.to_string());
            return Err(Failure::Arguments(format!("{title}: there is no candidate to draw: {why}")));
        }
        Ok(Self { title, matches, all, shown })
    }
}

impl Judged {
    /// What the theorem says, in words.
    fn words(&self) -> &'static str {
        match self.verdict {
            Verdict { is_ahead: false, .. } => "rejected by (a): points on the lower half",
            Verdict { turns_away: false, .. } => "rejected by (b): points turn towards t",
            Verdict { stays_on_its_side: false, .. } => "rejected by (c): points change sides",
            _ => "feasible",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_example_has_a_candidate_of_each_kind_and_both_forms() {
        let drawn = Drawn::new("t".to_owned(), scene::of_the_paper()).unwrap();
        let words: Vec<_> = drawn.shown.iter().map(Judged::words).collect();
        assert_eq!(words.len(), 3);
        assert!(words[0].contains("(a)") && words[2] == "feasible", "{words:?}");
        let svg = page::svg(&drawn).unwrap();
        assert!(svg.contains("feasible") && !svg.contains("NaN"));
        let html = page::html(&drawn).unwrap();
        let ours = &html[html.find("<h1>").unwrap()..];
        assert!(ours.contains("scatter3d"));
        // At most a dozen buttons for each of two spaces and the figure.
        let sections: Vec<_> = ours.split("<section>").skip(1).collect();
        assert_eq!(sections.len(), 4);
        assert!(sections.iter().all(|section| section.matches("<button").count() <= 12));
    }
}
