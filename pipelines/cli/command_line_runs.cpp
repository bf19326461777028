// Commands that make, judge and compare runs.
#include <CLI/CLI.hpp>

#include "pipelines/cli/command_line.h"
#include "pipelines/cli/options.h"
#include "pipelines/study/key.h"

namespace hsi4d::cli {

void CommandLine::add_run(const std::vector<LossTerm>& terms) {
  RunArguments& a = run_arguments;
  CLI::App* command = app->add_subcommand("run", "Reconstruct a clip as a config says, into a run folder");
  command->add_option("CONFIG", a.config, "The config file")->required();
  add_overrides(*command, a.overrides);
  command->add_option("--out", a.out,
                      "The run folder; default: the first free runs/NAME, runs/NAME-2, ... with the config's name");
  command->add_flag("--resume", a.resume, "Go on with the run in the folder; the result has the same bits");
  add_threads(*command, a.threads);
  command->add_option("--seed", a.seed, "Seed, instead of the config's")->check(whole_number())->type_name("N");
  command->add_flag("--dry-run", a.dry_run, "Check config and inputs, tell what would be done, write nothing");
  command->add_flag("--print-config", a.print_config, "Print the config with every default filled in, and stop");
  command->callback([this, &terms] { run = [this, &terms] { return run_command(run_arguments, terms); }; });
}

void CommandLine::add_demo(const std::vector<LossTerm>& terms) {
  DemoArguments& a = demo_arguments;
  CLI::App* command = app->add_subcommand("demo", "The method on a generated scene with ground truth");
  command->add_flag("--quick", a.quick, "256x256 pixels and 8 frames: less than a minute");
  command->add_option("--out", a.out, "Folder of dataset and run; default: the first free runs/demo, runs/demo-2, ...");
  add_overrides(*command, a.overrides);
  command->add_flag("--quiet", a.quiet, "No progress on stderr");
  command->add_flag("--resume", a.resume, "Go on with the demo in --out; the result has the same bits");
  add_threads(*command, a.threads);
  command->callback([this, &terms] { run = [this, &terms] { return demo_command(demo_arguments, terms); }; });
}

void CommandLine::add_synth() {
  CLI::App* synth = app->add_subcommand("synth", "Make a dataset with exact ground truth");
  synth->add_option("CONFIG", config, "A config; section synthetic says what is made, the rest goes along")->required();
  synth->add_option("--out", out, "Where to: a new or empty folder")->type_name("DIR")->required();
  add_overrides(*synth, overrides);
  synth->add_flag("--quiet", quiet, "No progress on stderr");
  synth->callback([this] { run = [this] { return synth_command(config, overrides, out, quiet, losses); }; });
}

void CommandLine::add_select_camera() {
  SelectCameraOptions& o = select_camera;
  CLI::App* command = app->add_subcommand("select-camera", "Choose the camera of a clip's first frame");
  command
      ->add_option("CONFIG", o.config,
                   "A config with scene, avatar and initial state; section camera_selection says how")
      ->required();
  add_overrides(*command, o.overrides);
  command->add_option("--out", o.out, "Where to: a camera file")->type_name("F.json");
  command->add_option("--image", o.image, "Image of what it sees")->type_name("F.{png,jpg,exr}");
  command->add_flag("--quiet", o.quiet, "No progress on stderr");
  command->callback([this] { run = [this] { return select_camera_command(select_camera, losses); }; });
}

void CommandLine::add_evaluate() {
  EvaluateOptions& o = evaluate;
  EvaluationSettings& s = o.settings;
  CLI::App* command =
      app->add_subcommand("evaluate", "Errors of runs and motions against the truth, and what of them needs none");
  command
      ->add_option(
          "RUN", o.inputs,
          "Folders of runs, motions by AMASS's or SMPL-X's names (.npz), folders of SMPLer-X's files; of a sweep "
          "its folder, for all runs that are done, or SWEEP/NAME, for those of that name: "
          "runs/ablations/whole")
      ->required();
  command
      ->add_option("--truth", s.truth,
                   "What they are compared with: a dataset of hsi4d synth, a run, a motion; for runs what their config "
                   "names, without")
      ->type_name("PATH");
  command->add_option("--data", s.data, "A dataset or run in whose scene the motions are, with its objects and avatar")
      ->type_name("PATH");
  command
      ->add_option("--body-model", s.body_model,
                   "A SMPL-X file: joints are those of this body, each motion's in its own shape")
      ->type_name("M.npz");
  command
      ->add_option("--avatar", s.avatar,
                   "Joints are those of this avatar; without either, of the avatar of the run or dataset")
      ->type_name("F.safetensors");
  add_evaluate_scene(*command);
  command
      ->add_option("--from-rate", s.from_rate,
                   "Frames a second of the motions, instead of what they say; of a truth that does not say it too")
      ->type_name("HZ");
  command->add_option("--frame-rate", s.frame_rate, "Frames a second to measure at, instead of the slower ones")
      ->type_name("HZ");
  command
      ->add_option(
          "--up", o.up,
          "Which axis of motions is up, y or z, instead of what is found; of a truth by other names than AMASS's "
          "too")
      ->type_name("AXIS");
  command
      ->add_option("--align", o.align,
                   "How a motion is laid on frame 0 of the truth or the data: none, heading or rotation")
      ->type_name("HOW");
  command->add_option("--person", s.person, "Which person of a folder, from 0")->check(whole_number())->type_name("N");
  command
      ->add_option("--clip", o.clips,
                   "Embeddings by CLIP, a file for each RUN; without, clip.npz in a run's folder where it is there")
      ->type_name("F.npz")
      ->allow_extra_args(false);
  command->add_option("--json", o.json, "Write all numbers into a file, those of each frame too")->type_name("F");
  command
      ->add_option("--export", o.export_folder,
                   "Write trajectories and initial states there, for TRUMANS, LINGO and CHOIS to start from")
      ->type_name("DIR");
  command->callback([this] { run = [this] { return evaluate_command(evaluate); }; });
}

void CommandLine::add_evaluate_scene(CLI::App& command) {
  EvaluationSettings& s = evaluate.settings;
  command.add_option("--surface", s.surface, "A mesh of what is solid (.obj, .ply, .glb)")->type_name("F");
  command.add_option("--occupancy", s.occupancy, "A grid of voxels instead, free or occupied")->type_name("F.npz");
  command.add_option("--scene", s.scene, "Gaussians instead, of what they show")->type_name("F.ply");
  command
      .add_option("--objects", s.objects, "Poses of objects in the scene beside a motion, z up, as a run's objects.npz")
      ->type_name("F.npz");
  command
      .add_option("--object-surface", evaluate.object_surfaces,
                  "A mesh of an object, instead of what its Gaussians show; may be given several times")
      ->type_name("NAME=F")
      ->allow_extra_args(false);
}

void CommandLine::add_report() {
  CLI::App* report = app->add_subcommand("report", "Write report.html of runs and sweeps, and print their errors");
  report->add_option("RUN", runs, "Folders of runs or sweeps; SWEEP/NAME: runs of a sweep by name")->required();
  report->callback([this] { run = [this] { return report_command(runs); }; });
}

void CommandLine::add_study() {
  StudyOptions& o = study;
  CLI::App* command =
      app->add_subcommand("study", "Make a page on which people choose between videos, or tell what they chose");
  command
      ->add_option("RUNS", o.runs,
                   "A and B: two runs, two folders of runs with the same names, or runs of sweeps: SWEEP/NAME, as "
                   "runs/ablations/whole")
      ->expected(0, 2)
      ->option_text("A B");
  command->add_option("--out", o.out, "Where the page goes: a new or empty folder; the key goes beside it")
      ->type_name("DIR");
  command
      ->add_option("--texts", o.texts,
                   "What happens in the videos, {\"NAME\": \"text\"}; default: sources.prompt of the runs' configs")
      ->type_name("F.json");
  command->add_option("--pairs", o.pairs, "Pairs that a person is shown; default: " + std::to_string(kPairsPerPerson))
      ->check(CLI::Range(1, 1000))
      ->type_name("N");
  command->add_option("--seed", o.seed, "Names of videos and pairs follow from it; default: they are random")
      ->check(whole_number())
      ->type_name("N");
  command->add_flag("--embed", o.embed, "One file: the videos are in the page");
  command->add_flag("--quiet", o.quiet, "No progress on stderr");
  command->add_option("--answers", o.answers, "Files that people saved, or folders of them; A and B are then left out")
      ->type_name("F.json");
  command->add_option("--key", o.key, "Of answers: the study's key")->type_name("F.json");
  command->add_option("--csv", o.csv, "Of answers: file for them, a line each")->type_name("F");
  command->add_option("--json", o.json, "Of answers: file for all numbers")->type_name("F");
  command->callback([this] { run = [this] { return study_command(study); }; });
}

void CommandLine::add_sweep(const std::vector<LossTerm>& terms) {
  SweepArguments& a = sweep;
  CLI::App* command = app->add_subcommand("sweep", "Many runs from one file: ablations, grids, clips, seeds");
  command->add_option("SWEEP", a.sweep, "The sweep's file, or the folder of one that is to go on")->required();
  command->add_option("--out", a.out, "The sweep's folder; default: runs/NAME with the sweep's name")->type_name("DIR");
  command->add_option("--launcher", a.launcher, "local: processes here; slurm: a job array")
      ->type_name("local|slurm")
      ->capture_default_str();
  command->add_option("--jobs", a.jobs, "The most runs at once; default: as many as there are threads for")
      ->check(whole_number(std::numeric_limits<int>::max()))
      ->type_name("N");
  add_threads(*command, a.threads);
  command->add_option("--memory", a.memory_mb, "Memory for all runs together, MB; default: 90 % of what is free")
      ->check(CLI::NonNegativeNumber)
      ->type_name("MB");
  command->add_flag("--fail-fast", a.fail_fast, "Stop at the first run that fails, the others with their state saved");
  command->add_flag("--resume", a.resume, "Go on with the sweep in the folder; runs that are done stay");
  command->add_flag("--dry-run", a.dry_run, "Check every combination, print the table of runs, write nothing");
  command->callback([this, &terms] { run = [this, &terms] { return sweep_command(sweep, terms, status); }; });
}

void CommandLine::add_run_one(const std::vector<LossTerm>& terms) {
  RunOneArguments& a = run_one;
  CLI::App* command = app->add_subcommand("run-one", "One run of a sweep, by its index in the table of --dry-run");
  command->add_option("SWEEP", a.sweep, "The sweep's file, or its folder")->required();
  command->add_option("INDEX", a.index, "From 0")->check(whole_number())->required();
  command->add_option("--out", a.out, "The sweep's folder; default: runs/NAME with the sweep's name")->type_name("DIR");
  add_threads(*command, a.threads);
  command->add_option("--parent", a.parent, "End, with the state saved, when this process does")
      ->check(whole_number(std::numeric_limits<int>::max()))
      ->type_name("PROCESS");
  command->add_flag("--requeue", a.requeue, "On SIGUSR1 save the state and put this job of Slurm into the queue again");
  command->callback([this, &terms] { run = [this, &terms] { return run_one_command(run_one, terms, status); }; });
}

}  // namespace hsi4d::cli
