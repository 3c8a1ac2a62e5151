//! What a calibration says, whatever the file's form: values by their keys.

use std::collections::BTreeMap;

/// Values by the path to them, such as `cameramatrix.data`: in small letters and without underscores, which programs write
/// differently.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(super) struct Keys {
    values: BTreeMap<String, Vec<String>>,
    /// The first part of each path as the file has it, in its order.
    pub(super) names: Vec<String>,
}

impl Keys {
    /// Appends a value. `path` is the way to it as the file has it.
    pub(super) fn push(&mut self, path: &[&str], value: &str) {
        if let Some(name) = path.first().filter(|name| !self.names.iter().any(|known| known == *name)) {
            self.names.push((*name).to_owned());
        }
        self.values.entry(plain(&path.join("."))).or_default().push(value.to_owned());
    }

    /// The values of the first of these names that the file has, and the name. Those of a matrix stand under its `data`.
    pub(super) fn find(&self, names: &[&'static str], id: Option<&str>) -> Option<(&'static str, &[String])> {
        names.iter().find_map(|name| {
            let short = plain(name);
            let paths = match id.map(plain) {
                None => vec![short],
                Some(id) => vec![format!("{id}.{short}"), format!("{short}{id}")],
            };
            let get = |path: &String| {
                self.values.get(&format!("{path}.data")).or_else(|| self.values.get(path)).map(Vec::as_slice)
            };
            Some((*name, paths.iter().find_map(get)?))
        })
    }
}

fn plain(name: &str) -> String {
    name.to_ascii_lowercase().replace('_', "")
}
