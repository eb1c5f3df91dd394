//! A panic hook that does not abort on panics of a decoder crate.

/// Ignores panics inside the crate whose source folder begins with `crate_prefix`, such as `exr-`: the readers
/// catch them. All other panics still abort the fuzzer.
pub fn ignore_decoder_panics(crate_prefix: &'static str) {
    let abort = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        let source_folder = format!("/{crate_prefix}");
        let is_in_decoder =
            panic.location().is_some_and(|location| location.file().contains(&source_folder));
        if !is_in_decoder {
            abort(panic);
        }
    }));
}
