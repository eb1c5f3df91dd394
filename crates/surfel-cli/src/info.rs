//! stub
#[derive(clap::Args)]
pub struct Args {}
pub fn run(_args: &Args, _report: &crate::report::Report) -> anyhow::Result<()> {
    Ok(())
}
