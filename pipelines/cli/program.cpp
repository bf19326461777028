// The command line: the only file that includes CLI11.
#include "pipelines/cli/program.h"

#include <charconv>
#include <csignal>
#include <cstdio>
#include <functional>
#include <limits>
#include <optional>

#include <CLI/CLI.hpp>

#include "core/check.h"
#include "core/config_value.h"
#include "core/log.h"
#include "core/simd.h"
#include "core/text.h"
#include "core/version.h"
#include "pipelines/cli/avatar_command.h"
#include "pipelines/cli/avatar_fit_command.h"
#include "pipelines/cli/bench_command.h"
#include "pipelines/cli/bench_pareto_command.h"
#include "pipelines/cli/bench_scaling_command.h"
#include "pipelines/cli/bench_stages_command.h"
#include "pipelines/cli/command_words.h"
#include "pipelines/cli/commands.h"
#include "pipelines/cli/convert_command.h"
#include "pipelines/cli/demo_command.h"
#include "pipelines/cli/evaluate_command.h"
#include "pipelines/cli/failure.h"
#include "pipelines/cli/gradients_command.h"
#include "pipelines/cli/info_command.h"
#include "pipelines/cli/motion_command.h"
#include "pipelines/cli/pose_command.h"
#include "pipelines/cli/render_command.h"
#include "pipelines/cli/report_command.h"
#include "pipelines/cli/run_command.h"
#include "pipelines/cli/select_camera_command.h"
#include "pipelines/cli/stress_command.h"
#include "pipelines/cli/study_command.h"
#include "pipelines/cli/sweep_command.h"
#include "pipelines/cli/synth_command.h"
#include "pipelines/study_key.h"

namespace hsi4d::cli {
namespace {

void print(const std::string& text) {
  const bool written = std::fwrite(text.data(), 1, text.size(), stdout) == text.size() && std::fflush(stdout) == 0;
  if (!written) throw UserError("hsi4d: standard output cannot be written to");
}

int complain(const Failure& failure) {
  std::fprintf(stderr, "%s\n", failure.message.c_str());
  return failure.status;
}

/// Refuses what is no whole number from 0 on, in words.
class WholeNumber : public CLI::Validator {
 public:
  explicit WholeNumber(std::int64_t most = std::numeric_limits<std::int64_t>::max()) : CLI::Validator("") {
    func_ = [most](const std::string& text) {
      std::int64_t number = -1;
      const auto end = std::from_chars(text.data(), text.data() + text.size(), number);
      if (end.ec == std::errc() && end.ptr == text.data() + text.size() && number >= 0 && number <= most)
        return std::string();
      const bool is_open = most == std::numeric_limits<std::int64_t>::max();
      return json_string(text) + " is out of range, or not a whole number; allowed: 0 " +
             (is_open ? "or more" : "to " + std::to_string(most));
    };
  }
};

/// The subcommands with their arguments; `run` is what the chosen one does.
struct CommandLine {
  CLI::App app{"4D human-scene interaction from video by differentiable Gaussian splatting", "hsi4d"};
  std::string config, topic, file, out, kind = "run";
  std::vector<std::string> overrides, runs;
  bool print_config = false, quiet = false, json = false;
  AvatarOptions avatar;
  ConvertOptions convert;
  RunArguments run_arguments;
  DemoArguments demo_arguments;
  std::vector<LossDescription> losses;
  RenderOptions render;
  GradientsOptions gradients;
  PoseOptions pose;
  MotionOptions motion;
  BenchOptions bench;
  BenchStagesOptions bench_stages;
  BenchScalingOptions bench_scaling;
  StressOptions stress;
  BenchParetoOptions bench_pareto;
  SelectCameraOptions select_camera;
  EvaluateOptions evaluate;
  StudyOptions study;
  SweepArguments sweep;
  RunOneArguments run_one;
  std::function<std::string()> run;
  int status = kDone;  ///< that `run` leaves

  explicit CommandLine(const std::vector<LossTerm>& terms) : losses(descriptions_of(terms)) {
    app.set_version_flag("--version", std::string("hsi4d ") + version() + " (" + git_commit() + ")");
    app.require_subcommand(1);
    app.failure_message(CLI::FailureMessage::simple);

    add_run(terms);
    add_demo(terms);
    add_synth();
    add_select_camera();
    add_evaluate();
    add_report();
    add_study();
    add_sweep(terms);
    add_run_one(terms);
    add_render();
    add_gradients();
    add_avatar(terms);
    add_pose();
    add_motion();
    add_convert();
    add_info();
    add_bench(terms);
    add_stress();
    add_check();
    add_schema();
    add_list();
  }

 private:
  void add_run(const std::vector<LossTerm>& terms) {
    RunArguments& a = run_arguments;
    CLI::App* command = app.add_subcommand("run", "Reconstruct a clip as a config says, into a run folder");
    command->add_option("CONFIG", a.config, "The config file")->required();
    add_overrides(*command, a.overrides);
    command->add_option("--out", a.out,
                        "The run folder; default: the first free runs/NAME, runs/NAME-2, ... with the config's name");
    command->add_flag("--resume", a.resume, "Go on with the run in the folder; the result has the same bits");
    add_threads(*command, a.threads);
    command->add_option("--seed", a.seed, "Seed, instead of the config's")->check(WholeNumber())->type_name("N");
    command->add_flag("--dry-run", a.dry_run, "Check config and inputs, tell what would be done, write nothing");
    command->add_flag("--print-config", a.print_config, "Print the config with every default filled in, and stop");
    command->callback([this, &terms] { run = [this, &terms] { return run_command(run_arguments, terms); }; });
  }

  void add_demo(const std::vector<LossTerm>& terms) {
    DemoArguments& a = demo_arguments;
    CLI::App* command = app.add_subcommand("demo", "The method on a generated scene with ground truth");
    command->add_flag("--quick", a.quick, "256x256 pixels and 8 frames: less than a minute");
    command->add_option("--out", a.out,
                        "Folder of dataset and run; default: the first free runs/demo, runs/demo-2, ...");
    add_overrides(*command, a.overrides);
    command->add_flag("--quiet", a.quiet, "No progress on stderr");
    command->add_flag("--resume", a.resume, "Go on with the demo in --out; the result has the same bits");
    add_threads(*command, a.threads);
    command->callback([this, &terms] { run = [this, &terms] { return demo_command(demo_arguments, terms); }; });
  }

  void add_synth() {
    CLI::App* synth = app.add_subcommand("synth", "Make a dataset with exact ground truth");
    synth->add_option("CONFIG", config, "A config; section synthetic says what is made, the rest goes along")
        ->required();
    synth->add_option("--out", out, "Where to: a new or empty folder")->type_name("DIR")->required();
    add_overrides(*synth, overrides);
    synth->add_flag("--quiet", quiet, "No progress on stderr");
    synth->callback([this] { run = [this] { return synth_command(config, overrides, out, quiet, losses); }; });
  }

  void add_select_camera() {
    SelectCameraOptions& o = select_camera;
    CLI::App* command = app.add_subcommand("select-camera", "Choose the camera of a clip's first frame");
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

  void add_evaluate() {
    EvaluateOptions& o = evaluate;
    EvaluationSettings& s = o.settings;
    CLI::App* command =
        app.add_subcommand("evaluate", "Errors of runs and motions against the truth, and what of them needs none");
    command
        ->add_option("RUN", o.inputs,
                     "Folders of runs, motions by AMASS's or SMPL-X's names (.npz), folders of SMPLer-X's files")
        ->required();
    command
        ->add_option(
            "--truth", s.truth,
            "What they are compared with: a dataset of hsi4d synth, a run, a motion; for runs what their config "
            "names, without")
        ->type_name("PATH");
    command
        ->add_option("--data", s.data, "A dataset or run in whose scene the motions are, with its objects and avatar")
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
    command->add_option("--from-rate", s.from_rate, "Frames a second of the motions, instead of what they say")
        ->type_name("HZ");
    command->add_option("--frame-rate", s.frame_rate, "Frames a second to measure at, instead of the slower ones")
        ->type_name("HZ");
    command->add_option("--up", o.up, "Which axis of motions is up, y or z, instead of what is found")
        ->type_name("AXIS");
    command
        ->add_option("--align", o.align,
                     "How a motion is laid on frame 0 of the truth or the data: none, heading or rotation")
        ->type_name("HOW");
    command->add_option("--person", s.person, "Which person of a folder, from 0")->check(WholeNumber())->type_name("N");
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

  /// What is solid, and where objects are.
  void add_evaluate_scene(CLI::App& command) {
    EvaluationSettings& s = evaluate.settings;
    command.add_option("--surface", s.surface, "A mesh of what is solid (.obj, .ply, .glb)")->type_name("F");
    command.add_option("--occupancy", s.occupancy, "A grid of voxels instead, free or occupied")->type_name("F.npz");
    command.add_option("--scene", s.scene, "Gaussians instead, of what they show")->type_name("F.ply");
    command.add_option("--objects", s.objects, "Poses of objects beside a motion, as a run's objects.npz")
        ->type_name("F.npz");
    command
        .add_option("--object-surface", evaluate.object_surfaces,
                    "A mesh of an object, instead of what its Gaussians show; may be given several times")
        ->type_name("NAME=F")
        ->allow_extra_args(false);
  }

  void add_report() {
    CLI::App* report = app.add_subcommand("report", "Write report.html of runs and sweeps, and print their errors");
    report->add_option("RUN", runs, "Folders of runs or sweeps")->required();
    report->callback([this] { run = [this] { return report_command(runs); }; });
  }

  void add_study() {
    StudyOptions& o = study;
    CLI::App* command =
        app.add_subcommand("study", "Make a page on which people choose between videos, or tell what they chose");
    command->add_option("RUNS", o.runs, "A and B: two folders of runs, or of folders of runs with the same names")
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
        ->check(WholeNumber())
        ->type_name("N");
    command->add_flag("--embed", o.embed, "One file: the videos are in the page");
    command->add_flag("--quiet", o.quiet, "No progress on stderr");
    command
        ->add_option("--answers", o.answers, "Files that people saved, or folders of them; A and B are then left out")
        ->type_name("F.json");
    command->add_option("--key", o.key, "Of answers: the study's key")->type_name("F.json");
    command->add_option("--csv", o.csv, "Of answers: file for them, a line each")->type_name("F");
    command->add_option("--json", o.json, "Of answers: file for all numbers")->type_name("F");
    command->callback([this] { run = [this] { return study_command(study); }; });
  }

  void add_sweep(const std::vector<LossTerm>& terms) {
    SweepArguments& a = sweep;
    CLI::App* command = app.add_subcommand("sweep", "Many runs from one file: ablations, grids, clips, seeds");
    command->add_option("SWEEP", a.sweep, "The sweep's file, or the folder of one that is to go on")->required();
    command->add_option("--out", a.out, "The sweep's folder; default: runs/NAME with the sweep's name")
        ->type_name("DIR");
    command->add_option("--launcher", a.launcher, "local: processes here; slurm: a job array")
        ->type_name("local|slurm")
        ->capture_default_str();
    command->add_option("--jobs", a.jobs, "The most runs at once; default: as many as there are threads for")
        ->check(WholeNumber(std::numeric_limits<int>::max()))
        ->type_name("N");
    add_threads(*command, a.threads);
    command->add_option("--memory", a.memory_mb, "Memory for all runs together, MB; default: 90 % of what is free")
        ->check(CLI::NonNegativeNumber)
        ->type_name("MB");
    command->add_flag("--fail-fast", a.fail_fast,
                      "Stop at the first run that fails, the others with their state saved");
    command->add_flag("--resume", a.resume, "Go on with the sweep in the folder; runs that are done stay");
    command->add_flag("--dry-run", a.dry_run, "Check every combination, print the table of runs, write nothing");
    command->callback([this, &terms] { run = [this, &terms] { return sweep_command(sweep, terms, status); }; });
  }

  void add_run_one(const std::vector<LossTerm>& terms) {
    RunOneArguments& a = run_one;
    CLI::App* command = app.add_subcommand("run-one", "One run of a sweep, by its index in the table of --dry-run");
    command->add_option("SWEEP", a.sweep, "The sweep's file, or its folder")->required();
    command->add_option("INDEX", a.index, "From 0")->check(WholeNumber())->required();
    command->add_option("--out", a.out, "The sweep's folder; default: runs/NAME with the sweep's name")
        ->type_name("DIR");
    add_threads(*command, a.threads);
    command->add_option("--parent", a.parent, "End, with the state saved, when this process does")
        ->check(WholeNumber(std::numeric_limits<int>::max()))
        ->type_name("PROCESS");
    command->add_flag("--requeue", a.requeue,
                      "On SIGUSR1 save the state and put this job of Slurm into the queue again");
    command->callback([this, &terms] { run = [this, &terms] { return run_one_command(run_one, terms, status); }; });
  }

  void add_info() {
    CLI::App* info = app.add_subcommand("info", "Tell what is in a file: Gaussians, arrays, cameras, an image");
    info->add_option("FILE", file,
                     "A .ply, .splat, .spz, .npz, .npy, .safetensors, .json, .png, .jpg, .jpeg or .exr file")
        ->required();
    info->add_flag("--json", json, "Print one JSON object; for Gaussians");
    info->callback([this] { run = [this] { return info_command(file, json); }; });
  }

  void add_avatar(const std::vector<LossTerm>& terms) {
    AvatarOptions& o = avatar;
    CLI::App& command = *app.add_subcommand("avatar", "Make, import, learn or describe the Gaussians of a body");
    command.require_subcommand(1);
    const auto add_body = [&o](CLI::App& sub) {
      sub.add_option("--betas", o.betas, "Shape of the body model: the first betas; the mean shape without")
          ->type_name("B,B,...");
      sub.add_option("--out", o.out, "The avatar's file")->type_name("F.safetensors")->required();
    };

    CLI::App& make = *command.add_subcommand("make", "Dress a body in Gaussians, spread evenly over its surface");
    make.add_option("--body-model", o.body_model, "A SMPL-X file; without, the body that comes with the program")
        ->type_name("M.npz");
    make.add_option("--gaussians", o.settings.gaussians, "How many; 20,000 to 300,000 are useful")
        ->capture_default_str()
        ->type_name("N");
    make.add_option("--detail", o.settings.detail, "How much denser head, hands and feet are: 0 not at all, to 1")
        ->capture_default_str()
        ->type_name("X");
    make.add_option("--cover", o.settings.cover, "Size along the surface over the distance of neighbours")
        ->capture_default_str()
        ->type_name("X");
    make.add_option("--texture", o.settings.texture, "Contrast of the patterns, 0 to 1")
        ->capture_default_str()
        ->type_name("X");
    make.add_option("--seed", o.settings.seed, "Seed of the places")
        ->capture_default_str()
        ->check(WholeNumber())
        ->type_name("N");
    add_body(make);
    make.callback([this] { run = [this] { return avatar_make_command(avatar); }; });

    CLI::App& bind = *command.add_subcommand("import", "Bind the Gaussians of a file to a body model");
    bind.add_option("PLY", o.in, "Gaussians in the rest pose of the body model, in its frame: .ply, .splat or .spz")
        ->required();
    bind.add_option("--body-model", o.body_model, "A SMPL-X file; without, the body that comes with the program")
        ->type_name("M.npz");
    add_body(bind);
    bind.callback([this] { run = [this] { return avatar_import_command(avatar); }; });

    CLI::App& fit = *command.add_subcommand("fit", "Learn the look of an avatar from pictures of known poses");
    fit.add_option("CONFIG", config, "What is learnt from and how: configs/avatar/fit.json")->required();
    fit.add_option("--out", o.out, "The avatar's file")->type_name("F.safetensors")->required();
    add_overrides(fit, overrides);
    fit.add_flag("--quiet", quiet, "No progress on stderr");
    fit.callback([this, &terms] {
      run = [this, &terms] { return avatar_fit_command(config, overrides, avatar.out, quiet, terms); };
    });

    CLI::App& info = *command.add_subcommand("info", "Tell what is in an avatar's file");
    info.add_option("FILE", file, "An avatar")->required();
    info.callback([this] { run = [this] { return avatar_info_command(file); }; });
  }

  void add_convert() {
    ConvertOptions& o = convert;
    CLI::App& command = *app.add_subcommand("convert", "Convert Gaussians between formats: .ply, .splat, .spz");
    command.add_option("IN", o.in, "Gaussians: .ply (INRIA's or compressed), .splat or .spz")->required();
    command.add_option("OUT", o.out, "Where to; the ending says how: .ply, .compressed.ply, .splat or .spz")
        ->required();
    command.add_option("--scale", o.scale, "Multiply lengths, about the origin, first")->type_name("S");
    command.add_option("--rotate", o.rotate, "Turn about the origin, harmonics too: axis times angle in degrees")
        ->type_name("x,y,z");
    command.add_option("--translate", o.translate, "Move, last; metres")->type_name("x,y,z");
    command
        .add_option("--matrix", o.matrix, "Instead of the three: a 4x4 matrix row by row, 16 numbers apart by commas")
        ->type_name("M");
    command.add_option("--crop", o.crop, "Keep the Gaussians whose means are in this box of IN's coordinates")
        ->type_name("x0,y0,z0,x1,y1,z1");
    command.add_option("--min-opacity", o.min_opacity, "Leave out fainter Gaussians")->type_name("O");
    command.add_option("--sh-degree", o.sh_degree, "Degree of the harmonics, 0 to 3")->type_name("N");
    command.add_option("--spz-version", o.spz_version, "Version of .spz to write: 2, 3 or 4; 3 without")
        ->type_name("N");
    command.add_option("--spz-sh-bits", o.spz_sh_bits, "Bits of harmonics in .spz, degree 1 and above; 8,8 without")
        ->type_name("A,B");
    command.callback([this] { run = [this] { return convert_command(convert); }; });
  }

  void add_stress() {
    CLI::App* command = app.add_subcommand("stress",
                                           "Try every known way to fail: a row each, with what was measured, what is "
                                           "allowed, and what it would be without the remedy");
    command->add_option("--row", stress.rows, "Only these: A1, or a letter for its group; default: all")
        ->type_name("ID");
    add_threads(*command, stress.threads);
    command->add_option("--json", stress.json, "File for the figures, one JSON object a row")->type_name("F");
    command->add_flag("--functions", stress.functions,
                      "Instead: how far off exponentials, sigmoid, sines, rotations and harmonics are, in units in "
                      "the last place, on each instruction set");
    command->add_option("--points", stress.points, "Of --functions: arguments a row, 1000 or more")
        ->check(CLI::Range(Index(1000), Index(1) << 30))
        ->type_name("N");
    command->footer("Exit status: 1 when a row fails, or holds without its remedy too.");
    command->callback([this] {
      run = [this] {
        StressOutcome outcome = stress_command(stress);
        status = outcome.status;
        return outcome.text;
      };
    });
  }

  void add_bench(const std::vector<LossTerm>& terms) {
    CLI::App* command = app.add_subcommand("bench",
                                           "Measure the speed of the renderer, the body or a whole run, time against "
                                           "error, or the pixel filter: a table, and one JSON object a measurement");
    command->add_option("TOPIC", topic, "What: rasterize, skinning, color_net, pixel_filter, stages, scaling, pareto")
        ->required()
        ->check(CLI::IsMember({"rasterize", "skinning", "color_net", "pixel_filter", "stages", "scaling", "pareto"}));
    command->add_option("--workload", bench.workloads, "Only these; default: all; not of stages and scaling");
    command->add_option("--threads", bench.threads, "Threads; default: 1, of stages and scaling what the config says")
        ->check(CLI::Range(1, 1024));
    command
        ->add_option(
            "--repeats", bench.repeats,
            "Runs of each, of which the median is told; default: 9, of scaling 20; not of pixel_filter and stages")
        ->check(CLI::Range(1, 1000));
    command->add_option("--height", bench.heights_px, "Heights of the figures of pixel_filter, px; default: 32 to 512")
        ->check(CLI::Range(8.0, 2048.0));
    command->add_option("--json", bench.json, "File for the measurements, one JSON object a line");
    command->add_option("--config", bench_stages.config, "Of stages, scaling and pareto: the config that is run")
        ->type_name("F.json");
    command->add_option("--out", bench_stages.out,
                        "Of stages: folder of dataset and runs; default: runs/bench/CONFIG. Of pareto: folder that is "
                        "made for those of the reconstructions and removed again; default: runs/bench/pareto");
    command->add_option("--plot", bench_stages.plot, "Of stages, scaling and pareto: file for a picture")
        ->type_name("F.svg");
    add_bench_pareto(*command);
    command
        ->add_option("--axis", bench_scaling.axes,
                     "Of scaling: scene, avatar, image or threads, with its values or without; default: all")
        ->type_name("AXIS[=N,N...]");
    command->add_flag("--compare", bench_stages.compare, "Of stages: run again without skips, and tell the ratio");
    add_overrides(*command, bench_stages.overrides);
    command->callback([this, command, &terms] {
      const int threads = command->count("--threads") > 0 ? bench.threads : 0;
      if (command->count("--repeats") > 0) bench_scaling.repeats = bench.repeats;
      if (command->count("--config") > 0) bench_pareto.config = bench_stages.config;
      if (command->count("--out") > 0) bench_pareto.out = bench_stages.out;
      run = [this, threads, &terms] { return run_bench(threads, terms); };
    });
  }

  void add_bench_pareto(CLI::App& command) {
    BenchParetoOptions& o = bench_pareto;
    command.add_option("--csv", o.csv, "Of pareto: file for the measurements, a line each")->type_name("F.csv");
    command.add_option("--front", o.front, "Of pareto: file for a picture of what settings are chosen by, two panels")
        ->type_name("F.svg");
    command
        .add_option(
            "--scene", o.scene_files,
            std::string("Of pareto: Gaussians of a file to measure too, or of all files in a folder, instead of all "
                        "that are made up unless --workload names some; ") +
                kSplatFormats)
        ->type_name("F.ply|DIR");
    command.add_option("--knob", o.knobs, "Of pareto: only these and the default; default: all");
    command
        .add_option("--seeds", o.seeds, "Of pareto: reconstructions of each setting; default: 5; 0 leaves these out")
        ->check(CLI::Range(0, 100));
  }

  /// @param threads  that were asked for; 0: none
  std::string run_bench(int threads, const std::vector<LossTerm>& terms) {
    if (topic == "stages") {
      bench_stages.json = bench.json;
      bench_stages.threads = threads;
      return bench_stages_command(bench_stages, terms);
    }
    if (topic == "scaling") {
      bench_scaling.config = bench_stages.config;
      bench_scaling.overrides = bench_stages.overrides;
      bench_scaling.threads = threads;
      bench_scaling.json = bench.json;
      bench_scaling.plot = bench_stages.plot;
      return bench_scaling_command(bench_scaling, terms);
    }
    if (topic == "pareto") {
      bench_pareto.scenes = bench.workloads;
      bench_pareto.overrides = bench_stages.overrides;
      bench_pareto.threads = bench.threads;
      bench_pareto.repeats = bench.repeats;
      bench_pareto.json = bench.json;
      bench_pareto.plot = bench_stages.plot;
      return bench_pareto_command(bench_pareto, terms);
    }
    if (topic == "skinning") return bench_skinning_command(bench);
    if (topic == "color_net") return bench_color_net_command(bench);
    return topic == "rasterize" ? bench_rasterize_command(bench) : bench_pixel_filter_command(bench);
  }

  void add_check() {
    CLI::App* check = app.add_subcommand("check", "Check a config and everything that it extends; tells all problems");
    check->add_option("CONFIG", config, "The config file")->required();
    add_overrides(*check, overrides);
    check->add_flag("--print-config", print_config, "Print the config with every default filled in");
    check->callback([this] { run = [this] { return check_command(config, overrides, print_config, losses); }; });
  }

  void add_schema() {
    CLI::App* schema = app.add_subcommand("schema", "Print the JSON Schema of configs, for editors");
    schema->add_option("KIND", kind, "Of which configs: " + joined(schema_kinds()) + "; default: run");
    schema->callback([this] { run = [this] { return schema_command(kind, losses); }; });
  }

  void add_list() {
    CLI::App* list = app.add_subcommand("list", "List what configs can name");
    list->add_option("TOPIC", topic, joined(list_topics()))->required();
    list->callback([this] { run = [this] { return list_command(topic, losses); }; });
  }

  static void add_threads(CLI::App& command, std::optional<int>& threads) {
    command.add_option("--threads", threads, "Threads, 0: one a core; results do not depend on it")
        ->check(WholeNumber(1024))
        ->type_name("N");
  }

  static void add_overrides(CLI::App& command, std::vector<std::string>& overrides) {
    add_several(command, "--set", overrides, "Change one setting: render.blur=0.1. The value is JSON, or else text")
        ->type_name("KEY=VALUE");
  }

  void add_render() {
    CLI::App& command = *app.add_subcommand("render", "Render Gaussians to an image: a scene, objects, a body");
    add_scene(command, render.shared);
    add_several(command, "--object", render.objects, "Gaussians drawn beside the scene, as they lie in their file")
        ->type_name("F.{ply,splat,spz}");
    command
        .add_option("--objects", render.object_poses,
                    "Poses of a run's objects: each --object NAME.ply is drawn where NAME is in --frame")
        ->type_name("O.npz");
    command.add_option("--motion", render.motion, "Motion of a body that is drawn too")->type_name("M.npz");
    command.add_option("--frame", render.frame, "Frame of motion and objects, from 0")
        ->check(WholeNumber())
        ->type_name("I");
    command.add_option("--avatar", render.avatar, "Gaussians of the body")->type_name("F.safetensors");
    command
        .add_option("--color-net", render.color_net,
                    "What colours the body in place of the avatar's own: a run's color_net.safetensors")
        ->type_name("F.safetensors");
    add_several(command, "--debug-pixel", render.pixels,
                "Print the Gaussians that make the pixel of column X and row Y, front to back, what was skipped, where "
                "it stopped, and the sums")
        ->type_name("X,Y");
    command.add_option("--out", render.out, "Where to: 8-bit PNG, OpenEXR, or arrays image, alpha, depth")
        ->type_name("F.{png,exr,npz}")
        ->required();
    command.callback([this] { run = [this] { return render_command(render); }; });
  }

  void add_gradients() {
    CLI::App& command = *app.add_subcommand("gradients", "Differentiate the difference of a render from an image");
    add_scene(command, gradients.shared)->required();
    command.add_option("--target", gradients.target, "The image to compare with")
        ->type_name("F.{exr,png,npz}")
        ->required();
    command.add_option("--out", gradients.out, "Where loss and gradients go")->type_name("F.npz")->required();
    command.footer(
        "Gradients are by the file's own numbers, its rows in order. They are 0 for what does not move the image: "
        "rows\n"
        "that the reader leaves out (a number that is not finite, a zero quaternion); log-scales and opacity logits\n"
        "that it holds at -20 or 20; coefficients above render.sh_degree; what the camera does not see.\n"
        "A pixel where alpha is held at render.alpha_cap adds nothing through that alpha, unless\n"
        "render.cap_gradient is pass (render.compatibility=inria makes it so).");
    command.callback([this] { run = [this] { return gradients_command(gradients); }; });
  }

  void add_pose() {
    CLI::App& command = *app.add_subcommand("pose", "Pose an SMPL-X body: vertices and joints of every frame");
    command.add_option("--body-model", pose.body_model, "The body, a SMPL-X file")->type_name("M.npz")->required();
    command
        .add_option("--params", pose.params,
                    "Its parameters by their names in smplx, [T,n] or [n]; what is not there is zero")
        ->type_name("P.npz")
        ->required();
    command.add_option("--out", pose.out, "Where vertices [T,V,3] and joints [T,J,3] go")
        ->type_name("F.npz")
        ->required();
    command.add_option("--precision", pose.precision, "float or double")->type_name("WORD");
    command
        .add_option("--hands", pose.hands,
                    "What the numbers of a hand are: full, 15 rotations; pca, coefficients of the model's components; "
                    "auto, rotations if there are 45 and else coefficients")
        ->type_name("WORD");
    command.add_flag("--flat-hand-mean", pose.flat_hand_mean,
                     "Hands are flat where their numbers are 0, not in the model's mean pose");
    command.footer(
        "Names: betas, expression, global_orient, body_pose, jaw_pose, leye_pose, reye_pose, left_hand_pose,\n"
        "right_hand_pose, transl. Rotations are axis-angle vectors in radians, lengths metres.");
    command.callback([this] { run = [this] { return pose_command(pose); }; });
  }

  void add_motion() {
    CLI::App& command = *app.add_subcommand("motion", "Change a motion of a body: frame rate, up axis, format");
    command
        .add_option("IN", motion.in, "A motion by AMASS's or SMPL-X's names (.npz), or a folder of SMPLer-X's files")
        ->required();
    command.add_option("OUT", motion.out, "A motion (.npz), or the body in motion (.glb)")->required();
    command
        .add_option("--from-rate", motion.from_rate,
                    "Frames a second of IN, instead of what it says; of a folder 30 without")
        ->type_name("HZ");
    command.add_option("--frame-rate", motion.frame_rate, "Frames a second of OUT")->type_name("HZ");
    command.add_flag("--y-up", motion.is_y_up, "IN's world has y up: turn it, about the pelvis");
    command
        .add_option(
            "--body-model", motion.body_model,
            "The body, a SMPL-X file: where its pelvis is, its mean hands (to which SMPLer-X's add), and what a "
            "GLB shows; without, the mean SMPL-X pelvis, and the program's own body")
        ->type_name("M.npz");
    command.add_option("--person", motion.person, "Which person of a folder, from 0")
        ->check(WholeNumber(std::numeric_limits<int>::max()))
        ->type_name("N");
    command.callback([this] { run = [this] { return motion_command(motion); }; });
  }

  /// Returns the option --scene.
  CLI::Option* add_scene(CLI::App& command, SceneOptions& options) {
    CLI::Option* const scene =
        command.add_option("--scene", options.scene, "Gaussians")->type_name("F.{ply,splat,spz}");
    command.add_option("--camera", options.camera, "A camera, or nerfstudio's transforms.json")
        ->type_name("C.json")
        ->required();
    command.add_option("--camera-frame", options.camera_frame, "Which camera of a file with several, from 0")
        ->check(WholeNumber())
        ->type_name("I");
    command.add_option("--background", options.background, "Colour behind everything; black without")
        ->type_name("r,g,b");
    command.add_option("--precision", options.precision, "float, double, or reference: brute force in double")
        ->type_name("WORD");
    add_several(command, "--set", options.settings, "Change a setting of the renderer: render.blur=0.1")
        ->type_name("render.KEY=VALUE");
    return scene;
  }

  /// An option that may be given several times, with one value each time.
  static CLI::Option* add_several(CLI::App& command, const std::string& name, std::vector<std::string>& values,
                                  const std::string& description) {
    return command.add_option(name, values, description)
        ->expected(1)
        ->multi_option_policy(CLI::MultiOptionPolicy::TakeAll)
        ->allow_extra_args(false);
  }
};

/// What a command knows, and its commands.
CommandWords words_of(const CLI::App& command) {
  CommandWords words{command.get_name(), {}, {}};
  for (const CLI::App* part : command.get_subcommands([](const CLI::App*) { return true; }))
    words.commands.push_back(words_of(*part));
  for (const CLI::Option* option : command.get_options()) {
    for (const std::string& name : option->get_lnames()) words.options.push_back("--" + name);
  }
  return words;
}

int run_commands(int argc, const char* const* argv, const std::vector<LossTerm>& losses) {
  CommandLine line(losses);
  check_words(argc, argv, words_of(line.app));
  try {
    line.app.parse(argc, argv);
  } catch (const CLI::CallForHelp&) {
    print(line.app.help());  // of the subcommand, if one was named
    return kDone;
  } catch (const CLI::CallForVersion& version_text) {
    print(std::string(version_text.what()) + "\n");
    return kDone;
  } catch (const CLI::ParseError& mistake) {
    std::string command = "hsi4d";
    for (auto chosen = line.app.get_subcommands(); !chosen.empty(); chosen = chosen.front()->get_subcommands())
      command += " " + chosen.front()->get_name();
    throw UserError(command + ": " + mistake.what() + "; `" + command + " --help` explains its arguments");
  }
  print(line.run());
  return line.status;
}

}  // namespace

int run_program(int argc, const char* const* argv, const std::vector<LossTerm>& losses) {
  try {
    const LogSink to_stderr = log_to(
        [](LogLevel level, std::string_view message) {
          std::fprintf(stderr, "hsi4d: %s%.*s\n",
                       level == LogLevel::kInfo ? "" : (std::string(log_level_name(level)) + ": ").c_str(),
                       static_cast<int>(message.size()), message.data());
        },
        LogLevel::kInfo);
    std::signal(SIGCHLD, SIG_DFL);  // whoever has started us may have it ignored: no program's end would be told us
    best_isa();                     // before any kernel runs
    return run_commands(argc, argv, losses);
  } catch (...) {
    return complain(describe_failure(std::current_exception()));
  }
}

}  // namespace hsi4d::cli
