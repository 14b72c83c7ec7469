// Partly transparent spheres are grainy, since random parts of them are drawn. While nothing moves, the picture is
// drawn again with other random numbers, and the mean of all drawings is shown.

const ROUNDS = 24;

class Smooth {
  // render: draws the scene on the canvas `stage`; round: the uniform that changes the random numbers.
  constructor(stage, mean, round, render) {
    Object.assign(this, { stage, mean, round, render, count: 0, waiting: 0 });
    this.context = mean.getContext("2d", { alpha: false });
  }

  // After each drawing: begins again, if the scene has a grain and stands still.
  restart(grainy) {
    cancelAnimationFrame(this.waiting);
    this.mean.hidden = true;
    this.count = 0;
    if (grainy) this.waiting = requestAnimationFrame(() => this.step());
  }

  step() {
    const { stage, mean, context } = this;
    if (this.count === 0) [mean.width, mean.height] = [stage.width, stage.height];
    this.count++;
    this.round.value = this.count;
    this.render();
    this.round.value = 0;
    context.globalAlpha = 1 / this.count;
    context.drawImage(stage, 0, 0);
    mean.hidden = false;
    if (this.count < ROUNDS) this.waiting = requestAnimationFrame(() => this.step());
  }
}
