//! The pipelines that the guide shows are YAML of the form that GitHub or GitLab reads. Their `drivebench` commands are checked by
//! `cargo test --test files guide`.

use saphyr::{LoadableYamlNode, Yaml};
use std::path::Path;

/// What is wrong with one pipeline is a panic. An environment of labgrid is no pipeline: its page runs it.
fn check(text: &str, place: &str) {
    let documents = Yaml::load_from_str(text).unwrap_or_else(|e| panic!("{place}: {e}"));
    let [pipeline] = documents.as_slice() else {
        panic!("{place}: one document is expected");
    };
    if pipeline.as_mapping_get("targets").is_some() {
        return;
    }
    let mut scripts = Vec::new();
    match pipeline.as_mapping_get("jobs") {
        Some(jobs) => github(pipeline, jobs, place, &mut scripts),
        None => gitlab(pipeline, place, &mut scripts),
    }
    let calls = scripts.iter().any(|script| script.contains("drivebench"));
    assert!(calls, "{place}: no job calls drivebench");
}

/// The blocks `yaml` of a page, each with its place.
fn blocks(page: &Path) -> Vec<(String, String)> {
    let text = std::fs::read_to_string(page).expect("a page");
    let mut found: Vec<(String, String)> = Vec::new();
    let mut inside = false;
    for (number, line) in (1..).zip(text.lines()) {
        if line.starts_with("```") {
            inside = line.starts_with("```yaml");
            if inside {
                found.push((format!("{}:{number}", page.display()), String::new()));
            }
        } else if let Some((_, block)) = found.last_mut().filter(|_| inside) {
            *block += &format!("{line}\n");
        }
    }
    found
}

#[test]
fn the_guide_s_pipelines_have_their_server_s_form() {
    let guide = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/../docs"));
    let mut checked = 0;
    for entry in std::fs::read_dir(guide).expect("the guide") {
        let page = entry.expect("a page").path();
        if page.extension().is_some_and(|extension| extension == "md") {
            for (place, block) in blocks(&page) {
                check(&block, &place);
                checked += 1;
            }
        }
    }
    assert!(checked >= 4, "{checked} pipelines");
}

#[test]
#[should_panic(expected = "no.yml: ")]
fn what_is_no_yaml_is_refused() {
    check("jobs: [\n", "no.yml");
}

#[test]
#[should_panic(expected = "script")]
fn a_job_without_a_script_is_refused() {
    check("stages: [test]\nsimulated:\n  stage: test\n", "no.yml");
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
