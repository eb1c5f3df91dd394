//! Errors as a page shows them: beside the control of the setting that they are about.

use surfel::file_names::list_files;
use surfel_web::Error;

/// Returns an error as a page shows it, with the key of the control that it belongs to.
pub fn rejection(error: impl Into<surfel::Error>) -> Error {
    match error.into() {
        error if error.is_cancelled() => Error::Cancelled,
        surfel::Error::Invalid(error) => {
            let text = error.reason();
            Error::InvalidRequest { key: Some(error.path).filter(|path| !path.is_empty()), text }
        }
        surfel::Error::NoPointKept { key, filter, hint, .. } => {
            let text = format!("no point meets {filter}{hint}");
            Error::InvalidRequest { key: key.map(str::to_owned), text }
        }
        surfel::Error::MissingColumn { files, key, text } => {
            Error::invalid_value(key, format!("{}: {text}", list_files(&files)))
        }
        surfel::Error::Core(error @ surfel_core::Error::Renderer(_)) => error.into(),
        error @ (surfel::Error::Threads(_)
        | surfel::Error::File(surfel_formats::Error::Io { .. })) => Error::Failed(one_line(&error)),
        error => Error::invalid_request(one_line(&error)),
    }
}

fn one_line(error: &surfel::Error) -> String {
    error.to_string().replace('\n', " ")
}
