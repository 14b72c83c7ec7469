// Temperature, ledger and collision rate, with a mark at the time shown.

const STROKES = ["#4c9be8", "#e69f00", "#e0653a", "#20b286"];

class Curves {
  constructor(element, logarithmicTime, seek) {
    this.element = element;
    this.logarithmic = logarithmicTime;
    this.seek = seek;
    this.plots = [];
  }

  draw() {
    for (const { plot } of this.plots) plot.destroy();
    this.element.replaceChildren();
    this.plots = [];
    if (!header.curves) return;
    const { time, panels } = header.curves;
    const style = getComputedStyle(document.documentElement);
    const [text, grid] = ["--soft", "--line"].map((name) => style.getPropertyValue(name));
    const first = this.logarithmic ? time.findIndex((value) => value > 0) : 0;
    // uPlot chooses ticks at multiples of 1e-16 or more: with smaller numbers on a logarithmic axis it does not end.
    // So it gets numbers in units of a power of ten.
    this.unit = powerOfTen([time], this.logarithmic);
    const inUnits = (values, unit) => values.slice(first).map((value) => (value === null ? null : value / unit));
    this.width = this.element.clientWidth;
    const height = Math.max(110, Math.min(190, (this.element.clientHeight - 16) / panels.length - 30));
    for (const panel of panels) {
      const title = document.createElement("h2");
      title.append(panel.title);
      const readings = panel.series.map(({ label }, k) => {
        const reading = document.createElement("span");
        reading.style.color = shade(panel.series[k].color ?? STROKES[k]);
        reading.dataset.label = label;
        title.append(reading);
        return reading;
      });
      this.element.append(title);
      const axis = { stroke: text, grid: { stroke: grid, width: 0.5 }, ticks: { stroke: grid, width: 0.5 } };
      const unit = powerOfTen(panel.series.map(({ values }) => values), panel.log);
      const labels = (unit) => (_, values) => values.map((value) => (value === null ? "" : format(value * unit, 3)));
      const plot = new uPlot(
        {
          width: Math.max(this.width - 16, 100),
          height,
          legend: { show: false },
          cursor: { drag: { x: false, y: false }, points: { show: false } },
          scales: {
            x: { time: false, distr: this.logarithmic ? 3 : 1, range: apart },
            y: { distr: panel.log ? 3 : 1 },
          },
          axes: [
            { ...axis, size: 26, values: labels(this.unit) },
            { ...axis, size: 58, values: labels(unit) },
          ],
          series: [{}, ...panel.series.map(({ color }, k) => ({ stroke: shade(color ?? STROKES[k]), width: 1.5, spanGaps: true }))],
        },
        [inUnits(time, this.unit), ...panel.series.map(({ values }) => inUnits(values, unit))],
        this.element,
      );
      const mark = document.createElement("div");
      mark.className = "now";
      plot.over.append(mark);
      plot.over.addEventListener("click", (event) => this.seek(plot.posToVal(event.offsetX, "x") * this.unit));
      this.plots.push({ plot, mark, panel, readings });
    }
  }

  // Draws again if the panel has another width.
  fit() {
    if (!this.element.hidden && this.element.clientWidth !== this.width) this.draw();
  }

  setLogarithmic(logarithmic) {
    if (logarithmic === this.logarithmic) return;
    this.logarithmic = logarithmic;
    this.draw();
  }

  move(time) {
    for (const { plot, mark, panel, readings } of this.plots) {
      const { min, max } = plot.scales.x;
      const x = plot.valToPos(Math.min(Math.max(time / this.unit, min), max), "x");
      mark.style.transform = `translateX(${x}px)`;
      const row = Math.max(0, after(header.curves.time, time * (1 + 1e-12)) - 1);
      readings.forEach((reading, k) => {
        // Of collisions the number at this time, not at that of the sample before.
        const value = panel.events ? panel.series[k].values[0] + after(panel.events, time * (1 + 1e-12)) : panel.series[k].values[row];
        reading.textContent = `${reading.dataset.label} ${value === null ? "–" : format(value, 4)}`;
      });
    }
  }
}

// A color of figures, which are on white; on the dark page lighter, so that it is seen as well.
function shade(color) {
  if (document.documentElement.className === "light") return color;
  const lighter = [1, 3, 5].map((start) => Math.round(0.7 * parseInt(color.slice(start, start + 2), 16) + 0.3 * 255));
  return `#${lighter.map((value) => value.toString(16).padStart(2, "0")).join("")}`;
}

// The power of ten below the numbers of all rows: below the largest, or on a logarithmic axis the smallest.
function powerOfTen(rows, logarithmic) {
  const sizes = rows.flat().map(Math.abs).filter((size) => size > 0);
  if (!sizes.length) return 1;
  return 10 ** Math.floor(Math.log10(logarithmic ? Math.min(...sizes) : Math.max(...sizes)));
}

// The range of an axis, wide enough for ticks that are different numbers.
function apart(_, low, high) {
  const least = 1e-9 * Math.max(Math.abs(low), Math.abs(high));
  return high - low > least ? [low, high] : [low - least, high + least];
}

// A number of few digits, without needless zeros.
function format(value, digits) {
  if (value === 0) return "0";
  const size = Math.abs(value);
  if (size >= 1e5 || size < 1e-3) return value.toExponential(digits - 1).replace(/\.?0+e/, "e").replace("e+", "e");
  return String(Number(value.toPrecision(digits)));
}
