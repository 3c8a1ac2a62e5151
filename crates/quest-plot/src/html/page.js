"use strict";
for (const section of document.querySelectorAll("section")) {
  const plots = [...section.querySelectorAll(".plot")];
  const buttons = [...section.querySelectorAll(".legend button")];
  for (const plot of plots) {
    const { data, layout } = JSON.parse(plot.nextElementSibling.textContent);
    Plotly.newPlot(plot, data, layout, { responsive: true, displayModeBar: false });
    // A point may have a curve that belongs into the other panels of its row.
    if (!data.some((trace) => trace.customdata)) continue;
    const others = [...plot.closest(".row").querySelectorAll(".plot")].filter((other) => other !== plot);
    const draw = (shapes) => others.forEach((other) => Plotly.relayout(other, { shapes }));
    plot.on("plotly_hover", ({ points: [point] }) => {
      const line = { color: point.fullData.marker.color, width: 2 };
      draw(point.customdata ? [{ type: "path", path: point.customdata, line }] : []);
    });
    plot.on("plotly_unhover", () => draw([]));
  }
  const show = (button, isShown) => {
    button.setAttribute("aria-pressed", isShown);
    for (const plot of plots) {
      const traces = plot.data.flatMap((trace, k) => (trace.name === button.dataset.name ? [k] : []));
      if (traces.length > 0) Plotly.restyle(plot, { visible: isShown ? true : "legendonly" }, traces);
    }
  };
  const isShown = (button) => button.getAttribute("aria-pressed") === "true";
  for (const button of buttons) {
    button.title = "click: switch on or off; double click: this one alone, or all";
    button.addEventListener("click", () => show(button, !isShown(button)));
    button.addEventListener("dblclick", () => {
      const others = buttons.filter((other) => other !== button);
      const isAlone = !others.some(isShown);
      for (const other of others) show(other, isAlone);
      show(button, true);
    });
  }
}
