// The frame that is looked at, as a line in every plot by frame; a click there goes to its frame.
const startPlots = () => {
  const plots = [...document.querySelectorAll("svg.plot.timed")].map(svg => {
    const [from, to, left, right] = ["from", "to", "left", "right"].map(name => +svg.dataset[name]);
    return { svg, line: svg.querySelector(".now"), placeOf: frame => left + (frame - from) / (to - from) * (right - left),
      frameAt: place => from + (place - left) / (right - left) * (to - from) };
  });
  for (const { svg, frameAt } of plots) {
    svg.addEventListener("click", event => {
      const box = svg.getBoundingClientRect();
      timeline.goNear(frameAt((event.clientX - box.left) / box.width * svg.viewBox.baseVal.width));
    });
  }
  timeline.onChange(frame => {
    for (const { svg, line, placeOf } of plots) {
      const place = placeOf(frame);
      line.setAttribute("x1", place);
      line.setAttribute("x2", place);
      const isInside = frame >= +svg.dataset.from && frame <= +svg.dataset.to;
      line.setAttribute("visibility", isInside ? "visible" : "hidden");
    }
  });
};
