// One picture in parts on Flamenco 3: put this file into the manager's `scripts` folder. Workers need the program
// `spectrasplat` and a folder that they share; they must be of one kind (their maps must lie at the same places).

const JOB_TYPE = {
  label: "SpectraSplat picture",
  settings: [
    { key: "scene", type: "string", required: true, description: "Scene file that all workers can read, or a shipped scene" },
    { key: "picture", type: "string", required: true, description: "The picture: .exr, .npy or .png" },
    { key: "photons", type: "string", default: "64M", description: "Photons in all" },
    { key: "parts", type: "int32", default: 16, description: "Into how many tasks light is divided" },
    { key: "size", type: "string", default: "1920x1080", description: "Pixels" },
    { key: "samples", type: "int32", default: 64, description: "Camera samples a pixel" },
    { key: "seed", type: "int32", default: 1, description: "Of the random numbers" },
  ],
};

const FAN_IN = 64; // parts that one task merges

function compileJob(job) {
  const settings = job.settings;
  let level = [];
  for (let part = 1; part <= settings.parts; part++) {
    const file = settings.picture + ".part" + part + ".ssp";
    const task = program("trace-" + part, [
      "render", settings.scene,
      "--size=" + settings.size,
      "--photons=" + settings.photons,
      "--spp=" + settings.samples,
      "--seed=" + settings.seed,
      "--passes=" + part + "/" + settings.parts,
      "-o", file,
    ]);
    job.addTask(task);
    level.push({ task: task, file: file });
  }
  // What is many is merged in a tree: no task reads more than FAN_IN files.
  for (let depth = 1; level.length > FAN_IN; depth++) {
    const next = [];
    for (let first = 0; first < level.length; first += FAN_IN) {
      const file = settings.picture + ".merged" + depth + "-" + next.length + ".ssp";
      next.push({ task: merge(job, level.slice(first, first + FAN_IN), [], file), file: file });
    }
    level = next;
  }
  merge(job, level, ["--scene=" + settings.scene], settings.picture);
}

function merge(job, level, options, file) {
  const task = program("merge-" + file.split("/").pop(),
    ["merge"].concat(level.map(function (one) { return one.file; }), options, ["-o", file]));
  for (let one of level) task.addDependency(one.task);
  job.addTask(task);
  return task;
}

function program(name, args) {
  const task = author.Task(name, "misc");
  task.addCommand(author.Command("exec", { exe: "spectrasplat", args: args }));
  return task;
}
