// Which times the slider and playback go through at a constant rate: those of a linear or a logarithmic scale, or of
// frames that are evenly spaced on neither.

const TIME_SCALES = { linear: "linear", log: "logarithmic", frames: "by frames" };

class Timeline {
  // times: of the frames, increasing; spacing: the scale on which they are even ("linear", "log" or "frames").
  constructor(times, spacing) {
    this.times = times;
    this.last = times.length - 1;
    this.start = times[0];
    this.end = times[this.last];
    // The first time that has a logarithm. What is before it takes the share of one interval, and is linear.
    this.first = times.find((time) => time > 0);
    this.lead = this.first > this.start ? 1 / this.last : 0;
    this.scales = ["linear"];
    if (this.first < this.end) this.scales.push("log");
    if (spacing === "frames") this.scales.push("frames");
    this.scale = this.scales.includes(spacing) ? spacing : "linear";
  }

  // A position is the number of a frame and the fraction of the way to the next, as one number.
  timeAt(at) {
    const k = Math.min(Math.floor(at), this.last);
    const next = Math.min(k + 1, this.last);
    return this.times[k] + (at - k) * (this.times[next] - this.times[k]);
  }

  placeOf(time) {
    const { times, last } = this;
    if (!(time > times[0])) return 0;
    if (time >= times[last]) return last;
    const k = after(times, time) - 1;
    return k + (time - times[k]) / (times[k + 1] - times[k]);
  }

  // Fraction of the slider at a position.
  share(at) {
    if (this.last === 0) return 0;
    if (this.scale === "frames") return at / this.last;
    const time = this.timeAt(at);
    if (this.scale === "linear") return (time - this.start) / (this.end - this.start || 1);
    if (time <= this.first) return this.lead && (this.lead * (time - this.start)) / (this.first - this.start);
    return this.lead + ((1 - this.lead) * Math.log(time / this.first)) / Math.log(this.end / this.first);
  }

  // Position at a fraction of the slider.
  position(share) {
    if (share <= 0) return 0;
    if (share >= 1) return this.last;
    if (this.scale === "frames") return share * this.last;
    if (this.scale === "linear") return this.placeOf(this.start + share * (this.end - this.start));
    if (share < this.lead) return this.placeOf(this.start + (share / this.lead) * (this.first - this.start));
    return this.placeOf(this.first * (this.end / this.first) ** ((share - this.lead) / (1 - this.lead)));
  }

  // Duration of the whole run at speed 1 [s].
  get seconds() {
    return Math.min(Math.max(this.last / 4, 8), 30);
  }

  // Position after some seconds of playback.
  advance(at, seconds, speed) {
    return this.position(this.share(at) + (seconds * speed) / this.seconds);
  }

  // What passes per second: time, decades or frames.
  rate(speed) {
    const spans = {
      linear: this.end - this.start,
      log: Math.log10(this.end / this.first) / (1 - this.lead),
      frames: this.last,
    };
    return { value: (spans[this.scale] * speed) / this.seconds, unit: { linear: "time", log: "decades" }[this.scale] ?? "frames" };
  }

  // Simulated time per second of playback at a position.
  flow(at, speed) {
    const { scale, first, end, start, lead } = this;
    const time = this.timeAt(at);
    let slope = end - start;
    if (scale === "frames") slope = this.last * this.interval(at);
    else if (scale === "log") slope = time <= first ? (first - start) / lead : (time * Math.log(end / first)) / (1 - lead);
    return (slope * speed) / this.seconds;
  }

  // Time between the frames around a position.
  interval(at) {
    const k = Math.min(Math.floor(at), Math.max(this.last - 1, 0));
    return this.last > 0 ? this.times[k + 1] - this.times[k] : 0;
  }
}

// First row whose value is greater.
function after(values, value) {
  let low = 0;
  let high = values.length;
  while (low < high) {
    const middle = (low + high) >> 1;
    if (values[middle] <= value) low = middle + 1;
    else high = middle;
  }
  return low;
}
