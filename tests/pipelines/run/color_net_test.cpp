// Runs whose human changes its colours in the course of the clip, with a color net and without.
#include <catch2/catch.hpp>

#include "core/check.h"
#include "core/image_io.h"
#include "core/npz.h"
#include "core/parallel.h"
#include "core/text.h"
#include "optim/checkpoint.h"
#include "pipelines/input/body_files.h"
#include "pipelines/synthetic/motion.h"
#include "pipelines/synthetic/render.h"
#include "pipelines/synthetic/scene.h"
#include "tests/support/tiny_run.h"

namespace color_net_test {

using namespace hsi4d;
using namespace hsi4d::test;
namespace fs = std::filesystem;

namespace {

const std::vector<std::string> kNone;

/// The avatar as frame t shows it: it darkens, and turns from its own colours to warmer ones.
Avatar changed(Avatar avatar, Index t) {
  const float share = 0.12F * static_cast<float>(t);
  for (std::size_t i = 0; i < avatar.colors.size(); ++i) {
    const float warm = i % 3 == 0 ? 1.1F : i % 3 == 1 ? 0.75F : 0.45F;
    avatar.colors[i] *= (1 - share) + share * warm;
    avatar.colors[i] *= 1 - 0.5F * share;
  }
  return avatar;
}

/// A dataset whose human changes colour from frame to frame; the avatar's file has those of frame 0.
void write_changing_dataset(const fs::path& folder, const SyntheticSettings& settings = TinyDataset::settings()) {
  ConfigProblems problems;
  write_dataset(settings, video_render_settings(), folder, {},
                load_config_text(kTinyStages, "tiny.json", folder.parent_path(), {}, problems));
  const BodyModel body = rest_body(BodySettings{});
  const SyntheticObject object = synthetic_object(settings);
  const SyntheticClip clip = synthetic_clip(body, object, clip_settings(settings));
  const Gaussians room = synthetic_scene(settings, clip.plan);
  const Avatar avatar = read_avatar(dataset_inputs(folder).avatar.string());
  const RenderSettings render = video_render_settings();  // the renderer keeps a reference
  for (std::size_t t = 0; t < clip.cameras.size(); ++t) {
    const Avatar seen = changed(avatar, static_cast<Index>(t));
    const SyntheticRenderer renderer(room, object.gaussians, seen, render);
    const SyntheticFrame frame =
        renderer.frame(clip.motion.poses[t], clip.object[t], clip.cameras[t], settings.supersample);
    write_image((folder / "frames" / (four_digits(static_cast<std::int64_t>(t)) + ".png")).string(), frame.color);
  }
}

/// Makes a stage of the config move a group in every fifth iteration.
void move_group(RunConfig& config, const std::string& group, double lr) {
  for (auto& [name, stage] : config.stages) {
    if (name != "interaction") continue;
    ParameterGroupSettings moved;
    moved.lr = lr;
    moved.every = 5;
    stage.optimize.emplace_back(group, moved);
  }
}

/// The same with a color net that a stage moves.
RunConfig config_with_net(const fs::path& dataset, int iterations, double lr, std::vector<std::string> overrides = {}) {
  overrides.insert(overrides.end(), {"color_net.use=on", "color_net.features=8", "color_net.hidden_width=16",
                                     "stages.interaction.iterations=" + std::to_string(iterations)});
  RunConfig config = config_in(dataset, overrides);
  move_group(config, "color_net", lr);
  return config;
}

}  // namespace

TEST_CASE("where the human's appearance changes, a color net beats none", "[run][color_net]") {
  const TemporaryFolder here;
  write_changing_dataset("changing");
  const RunSummary off = execute_tiny(config_in("changing", {"stages.interaction.iterations=60"}), "off");
  const RunSummary on = execute_tiny(config_with_net("changing", 60, 0.01), "on");
  const double psnr_off = last_number(off, "psnr_foreground_db"), psnr_on = last_number(on, "psnr_foreground_db");
  const double joints_off = last_number(off, "world_mpjpe_mm"), joints_on = last_number(on, "world_mpjpe_mm");
  WARN("PSNR of the foreground " << psnr_off << " dB without, " << psnr_on << " dB with a color net; world MPJPE "
                                 << joints_off << " mm without, " << joints_on << " mm with");
  CHECK(psnr_on > psnr_off + 1.5);
  CHECK(joints_on < 1.1 * joints_off);
}

TEST_CASE("the gain of a color net by learning rate and width", "[full][color_net]") {
  const TemporaryFolder here;
  SyntheticSettings settings = TinyDataset::settings();
  settings.frames = 6;
  settings.size_px = 128;
  settings.scene_gaussians = 5000;
  settings.avatar_gaussians = 3000;
  settings.object_gaussians = 500;
  write_changing_dataset("changing", settings);
  const std::string iterations = "stages.interaction.iterations=300";
  const RunSummary off = execute_tiny(config_in("changing", {iterations}), "off", 2);
  const double without = last_number(off, "psnr_foreground_db");
  WARN("without: " << without << " dB, " << last_number(off, "world_mpjpe_mm") << " mm");
  int count = 0;
  for (const double lr : {1e-5, 1e-4, 1e-3, 1e-2}) {
    for (const int width : {16, 32, 64}) {
      if (width != 32 && lr != 1e-2) continue;
      RunConfig config = config_in("changing", {"color_net.use=on", iterations});
      config.color_net.hidden_width = width;
      move_group(config, "color_net", lr);
      const RunSummary on = execute_tiny(config, "on" + std::to_string(++count), 2);
      const double with = last_number(on, "psnr_foreground_db");
      WARN("lr " << lr << ", width " << width << ": " << with << " dB, " << last_number(on, "world_mpjpe_mm") << " mm, "
                 << on.metrics.back().seconds << " s");
      CHECK(with > without - 0.05);
      if (lr >= 1e-3) CHECK(with > without + 1.5);
    }
  }
}

TEST_CASE("a color net moves in the iterations that its group says, and persists from frame to frame",
          "[run][color_net]") {
  const TemporaryFolder here;
  const RunConfig config = config_with_net(TinyDataset::folder(), 11, 0.002);
  execute_tiny(config, "on");
  // In iterations 0, 5 and 10 of every frame; the moments persist, so that the steps counted at the end are those of
  // the whole clip.
  const Clip clip = read_clip(config.data);
  const Npz checkpoint = Npz::read("on/checkpoint/progress.npz");
  CHECK(checkpoint.array("color_net/moments/color_net/steps").as<std::int64_t>()[0] == 3 * (kTinyFrames - 1));
  const std::optional<ColorNet> first = first_color_net(config.color_net, clip.avatar, config.seed);
  const std::optional<ColorNet> last =
      color_net_of(Safetensors::read("on/color_net.safetensors"), clip.avatar.count(), clip.avatar.joint_count());
  REQUIRE(last.has_value());
  CHECK(last->features == first->features);  // no stage moves them
  CHECK(last->layers.back().bias != first->layers.back().bias);
  for (const double b : last->layers.back().bias) CHECK(std::fabs(b) <= 3 * (kTinyFrames - 1) * 0.002 * 1.01);
}

TEST_CASE("a run with a color net that was stopped and resumed has the bits of one that never was",
          "[run][color_net]") {
  const TemporaryFolder here;
  for (const char* precision : {"float", "double"}) {
    RunConfig config = config_with_net(TinyDataset::folder(), 10, 0.01,
                                       {std::string("precision=") + precision, "color_net.view_direction=true"});
    move_group(config, "avatar_features", 0.01);
    const std::string whole = std::string("whole_") + precision, run = std::string("stopped_") + precision;
    execute_tiny(config, whole);
    for (const int last : {kPerFrame + 12, kPerFrame + 3}) {
      int count = 0;
      CHECK_THROWS_AS(execute_tiny(config, run, 1, true, [&] { return ++count == last; }), Interrupted);
    }
    execute_tiny(config, run, 2, true);
    CHECK(differences(whole, run) == kNone);
    CHECK(file_text(whole + "/color_net.safetensors") == file_text(run + "/color_net.safetensors"));
    CHECK(file_text(whole + "/checkpoint/progress.npz").size() == file_text(run + "/checkpoint/progress.npz").size());
  }
}

TEST_CASE("a color net that no stage moves changes nothing, and leaves no file", "[run][color_net]") {
  const TemporaryFolder here;
  const RunSummary off = execute_tiny(tiny_config(), "off");
  const RunSummary on = execute_tiny(tiny_config({"color_net.use=on"}), "on");
  CHECK_FALSE(fs::exists("on/color_net.safetensors"));
  CHECK(std::fabs(last_number(on, "psnr_db") - last_number(off, "psnr_db")) < 0.01);
  // auto: none, as the avatar's file has none
  execute_tiny(tiny_config({"color_net.use=auto"}), "auto");
  std::vector<std::string> names = differences("off", "auto");
  std::erase(names, "config.resolved.json");
  CHECK(names == kNone);
  RunConfig named = tiny_config({"color_net.use=off"});
  move_group(named, "color_net", 0.01);
  const RunSummary ablation = execute_tiny(named, "named");
  CHECK(last_number(ablation, "psnr_db") == last_number(off, "psnr_db"));
}

TEST_CASE("a run goes on with the network of the avatar's file", "[run][color_net]") {
  const TemporaryFolder here;
  fs::copy(TinyDataset::folder(), "data", fs::copy_options::recursive);
  const std::string file = dataset_inputs("data").avatar.string();
  Avatar avatar = read_avatar(file);
  avatar.color_net = new_color_net(avatar.means, avatar.joint_count(), {4, 8, 1, false, 7});
  avatar.color_net->layers.back().bias = {2, -2, 0.5};  // everything turns red
  write_avatar(file, avatar);
  CHECK(*read_avatar(file).color_net == *avatar.color_net);
  const RunSummary own = execute_tiny(config_in("data", {}), "own");
  const RunSummary off = execute_tiny(config_in("data", {"color_net.use=off"}), "off");
  CHECK(last_number(off, "psnr_foreground_db") > last_number(own, "psnr_foreground_db") + 3);
  const RunSummary on = execute_tiny(config_in("data", {"color_net.use=on"}), "on");
  CHECK(last_number(on, "psnr_db") == last_number(own, "psnr_db"));
}

TEST_CASE("a checkpoint with another color net is refused", "[run][color_net]") {
  const TemporaryFolder here;
  const RunConfig config = config_with_net(TinyDataset::folder(), 5, 0.01);
  int count = 0;
  CHECK_THROWS_AS(execute_tiny(config, "run", 1, false, [&] { return ++count == kPerFrame; }), Interrupted);
  const std::string file = "run/checkpoint/progress.npz";
  const auto refusal = [&](const std::string& name, std::vector<double> numbers) {
    const std::string hash = Npz::read(file).array("config_hash").text();
    Checkpoint checkpoint = load_checkpoint(file, hash);
    const std::vector<double> before = checkpoint.doubles(name);
    checkpoint.set(name, std::move(numbers));
    checkpoint.save(file, hash);
    std::string message = "no error";
    try {
      execute_tiny(config, "run", 1, true);
    } catch (const DataError& error) {
      message = error.what();
    }
    checkpoint.set(name, before);
    checkpoint.save(file, hash);
    return message;
  };
  CHECK(refusal("color_net/bias0", {1, 2, 3})
            .find("\"color_net/bias0\" holds 3 numbers, this color net has 16; the "
                  "inputs have changed since the run began") != std::string::npos);
  CHECK(
      refusal("color_net/bias2", {1, 2, std::nan("")}).find("\"color_net/bias2\" holds a number that is not finite") !=
      std::string::npos);
  CHECK(refusal("color_net/moments/color_net/1/mean", {1}).find("holds 1 numbers, this color net has 16") !=
        std::string::npos);
  execute_tiny(config, "run", 1, true);
}

}  // namespace color_net_test
