//! The example pipelines: YAML, of the form that GitHub or GitLab reads, with commands that the program takes.

use super::words;
use saphyr::{LoadableYamlNode, Yaml};

/// Looks at one pipeline; a mistake is a panic. An environment of labgrid is none.
pub(super) fn check(text: &str, place: &str) {
    let documents = Yaml::load_from_str(text).unwrap_or_else(|e| panic!("{place}: {e}"));
    let [pipeline] = documents.as_slice() else {
        panic!("{place}: one document is expected");
    };
    // The page runs an environment of labgrid itself.
    if pipeline.as_mapping_get("targets").is_some() {
        return;
    }
    let mut scripts = Vec::new();
    match pipeline.as_mapping_get("jobs") {
        Some(jobs) => github(pipeline, jobs, place, &mut scripts),
        None => gitlab(pipeline, place, &mut scripts),
    }
    let commands: Vec<_> = scripts.iter().flat_map(|s| words::commands(s)).collect();
    assert!(!commands.is_empty(), "{place}: no job calls drivebench");
    for command in commands {
        let refused = words::refused(&command, true);
        assert_eq!(refused, None, "{place}: {command:?}");
    }
}

fn text<'a>(node: Option<&'a Yaml<'_>>) -> Option<&'a str> {
    node.and_then(|node| node.as_str())
}

fn github(pipeline: &Yaml<'_>, jobs: &Yaml<'_>, place: &str, scripts: &mut Vec<String>) {
    assert!(
        pipeline.as_mapping_get("on").is_some(),
        "{place}: `on` is missing"
    );
    for (name, job) in jobs.as_mapping().expect("jobs") {
        let place = format!("{place}: job {name:?}");
        assert!(job.as_mapping_get("runs-on").is_some(), "{place}: runs-on");
        let steps = job.as_mapping_get("steps").and_then(|s| s.as_vec());
        for step in steps.unwrap_or_else(|| panic!("{place}: steps")) {
            let (run, uses) = (
                text(step.as_mapping_get("run")),
                text(step.as_mapping_get("uses")),
            );
            assert!(
                run.is_some() != uses.is_some(),
                "{place}: a step runs or uses something"
            );
            if let Some(uses) = uses {
                assert!(uses.contains('@'), "{place}: {uses} has no version");
            }
            scripts.extend(run.map(str::to_owned));
        }
    }
}

fn gitlab(pipeline: &Yaml<'_>, place: &str, scripts: &mut Vec<String>) {
    /// Keys at the top that are no jobs.
    const NO_JOBS: [&str; 6] = [
        "stages",
        "default",
        "variables",
        "workflow",
        "include",
        "image",
    ];
    let stages: Vec<_> = pipeline
        .as_mapping_get("stages")
        .and_then(|stages| stages.as_vec())
        .unwrap_or_else(|| panic!("{place}: neither `jobs` (GitHub) nor `stages` (GitLab)"))
        .iter()
        .filter_map(|stage| stage.as_str())
        .collect();
    for (name, job) in pipeline.as_mapping().expect("a pipeline") {
        let name = name.as_str().expect("a name");
        if NO_JOBS.contains(&name) || name.starts_with('.') {
            continue;
        }
        let place = format!("{place}: job {name}");
        let stage = text(job.as_mapping_get("stage")).unwrap_or("test");
        assert!(stages.contains(&stage), "{place}: no stage {stage}");
        assert!(job.as_mapping_get("script").is_some(), "{place}: script");
        for key in ["before_script", "script", "after_script"] {
            let lines = job.as_mapping_get(key).and_then(|lines| lines.as_vec());
            for line in lines.into_iter().flatten() {
                let line = line
                    .as_str()
                    .unwrap_or_else(|| panic!("{place}: {key}: {line:?}"));
                scripts.push(line.to_owned());
            }
        }
    }
}
