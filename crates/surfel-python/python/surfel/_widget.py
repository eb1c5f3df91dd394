"""The viewer's page in a cell of a notebook."""

from surfel._errors import InvalidSetting

HEIGHT_PX = 480

#: The page's origin is allowed first, so that the server lets no other page frame it.
_SCRIPT = """
function render({ model, el }) {
  const frame = document.createElement("iframe");
  frame.title = "surfel viewer";
  frame.style.cssText = `width: 100%; height: ${model.get("height")}px; border: 0`;
  frame.allow = "fullscreen; clipboard-write";
  const link = document.createElement("a");
  Object.assign(link, { href: model.get("link"), target: "_blank", textContent: model.get("link") });
  const show = () => {
    if (model.get("allowed") !== location.origin) return;
    frame.src = model.get("link");
    el.prepend(frame);
  };
  model.on("change:allowed", show);
  model.set("origin", location.origin);
  model.save_changes();
  el.append(link);
  show();
  return () => model.off("change:allowed", show);
}
export default { render };
"""


def mimebundle(viewer):
    """The view of a viewer in a notebook: its page by anywidget, or a link where anywidget is not installed."""
    try:
        import anywidget
        import traitlets
    except ImportError:
        return {"text/html": viewer._repr_html_(), "text/plain": repr(viewer)}
    return _widget_class(anywidget, traitlets)(viewer)._repr_mimebundle_()


def _widget_class(anywidget, traitlets):
    class ViewerWidget(anywidget.AnyWidget):
        """The page of a running viewer in a frame of the notebook."""

        _esm = _SCRIPT
        link = traitlets.Unicode().tag(sync=True)
        height = traitlets.Int(HEIGHT_PX).tag(sync=True)
        origin = traitlets.Unicode().tag(sync=True)
        allowed = traitlets.Unicode().tag(sync=True)

        def __init__(self, viewer):
            self._viewer = viewer
            super().__init__(link=viewer.url)

        @traitlets.observe("origin")
        def _allow(self, change):
            try:
                self._viewer.allow_frame(change["new"])
            except InvalidSetting:
                # A notebook without an address of the web, as that of VS Code, shows the link alone.
                return
            self.allowed = change["new"]

    return ViewerWidget
