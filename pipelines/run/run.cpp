#include "pipelines/run/run.h"

#include <exception>
#include <optional>
#include <utility>

#include "body/avatar_shape.h"
#include "core/check.h"
#include "core/config_value.h"
#include "core/log.h"
#include "core/parallel.h"
#include "core/progress.h"
#include "core/text.h"
#include "core/version.h"
#include "pipelines/config/parameter_groups.h"
#include "pipelines/config/run_notes.h"
#include "pipelines/config/run_problems.h"
#include "pipelines/draw/plate_mark.h"
#include "pipelines/draw/visibility.h"
#include "pipelines/input/body_files.h"
#include "pipelines/input/contacts.h"
#include "pipelines/report/report.h"
#include "pipelines/run/frame_start.h"
#include "pipelines/run/keypoint_motion.h"
#include "pipelines/run/lens_estimate.h"
#include "pipelines/run/pixel_filter.h"
#include "pipelines/sources/sources.h"
#include "splat/files/splat_file.h"

namespace hsi4d {

namespace {

/// Runs `body` on the threads that were asked for; 0: one a core.
template <class F>
void on_threads(int threads, F&& body) {
  if (threads > 0) return with_threads(threads, body);
  body();
}

/// What is logged before a run has its folder; it belongs into that folder's log too.
class EarlyMessages {
 public:
  /// What belongs into the log and would disturb on a terminal.
  void keep(std::string message) { messages_.emplace_back(LogLevel::kInfo, std::move(message)); }
  void move_to(const RunFolder& folder) {
    sink_.reset();
    for (const auto& [level, message] : messages_) folder.note(message, level);
  }

 private:
  std::vector<std::pair<LogLevel, std::string>> messages_;
  std::optional<LogSink> sink_ =
      log_to([this](LogLevel level, std::string_view message) { messages_.emplace_back(level, message); });
};

/// First line of a run's log.
std::string opening(const RunConfig& config, const Clip& clip, const RunIdentity& identity) {
  return "hsi4d " + std::string(version()) + " (" + git_commit() + "), run '" + config.name +
         "': " + std::to_string(clip.frames()) + " frames of " + std::to_string(clip.camera.width) + "x" +
         std::to_string(clip.camera.height) + " pixels, " + std::to_string(config.stages.size()) + " stages, " +
         std::to_string(identity.threads) + (identity.threads == 1 ? " thread, " : " threads, ") + identity.precision;
}

/// Last line of the log of a run that is done.
std::string closing(const RunSummary& summary) {
  std::string text = "done: " + std::to_string(summary.frames) + " frames in " + duration_text(summary.seconds);
  if (summary.metrics.empty()) return text;
  for (const char* name : {"psnr_db", "ssim", "mpjpe_mm", "object_translation_cm", "camera_translation_cm"}) {
    const double* const value = find_metric(summary.metrics.back().values, name);
    if (value != nullptr) text += ", " + std::string(name) + " " + rounded(*value, 4);
  }
  return text;
}

/// Sets render.blur where the config asks for an estimate. Returns what the log tells of it.
std::string estimate_blur(RunConfig& config, const Clip& clip) {
  if (!config.estimate_blur) return "";
  const PixelFilter filter = estimated_pixel_filter(config, clip);
  if (filter.is_widest) {
    log_warning(
        "render.blur \"estimate\": frame 0, drawn as it is given, is the nearer to the video's the more it is "
        "blurred, so it tells no filter; avatar, objects or the state of frame 0 may not be the video's. Used: " +
        number_text(config.render.blur) + " px^2");
    return "";
  }
  config.render.blur = filter.blur;
  return "render.blur estimated from frame 0: " + number_text(filter.blur) + " px^2 (PSNR of its foreground " +
         rounded(filter.psnr_db, 4) + " dB)";
}

/// Sets the lens where the config asks for an estimate. Returns what the log tells of it.
std::string estimate_lens(const RunConfig& config, Clip& clip) {
  if (!config.data.lens.estimate_k1) return "";
  const LensEstimate found = estimated_lens(config, clip);
  Lens lens = config.data.lens.lens;
  lens.k1 = found.is_widest ? 0 : found.k1;
  set_lens(lens, clip);
  if (found.is_widest) {
    log_warning(
        "data.lens.k1 \"estimate\": frame 0 is the nearer to the scene the more it is bent, so it tells no lens; "
        "scene or camera may not be the video's. Used: 0");
    return "";
  }
  return "data.lens.k1 estimated from frame 0: " + number_text(lens.k1) + " (PSNR of its background " +
         rounded(found.psnr_db, 4) + " dB)";
}

RunSummary reconstruct_into(RunFolder& folder, const RunConfig& config, Clip& clip, const std::vector<LossTerm>& losses,
                            const RunOptions& options) {
  try {
    RunSummary summary;
    on_threads(options.threads > 0 ? options.threads : config.threads,
               [&] { summary = reconstruct(config, clip, losses, folder, options.observer); });
    folder.set_state(RunState::kDone);  // the report tells it
    write_report(options.folder);
    folder.note(closing(summary));
    return summary;
  } catch (const Interrupted& stop) {
    note_end(folder, RunState::kInterrupted, stop.what());
    throw;
  } catch (const std::exception& failure) {
    note_end(folder, RunState::kFailed, failure.what());
    throw;
  }
}

}  // namespace

void note_end(RunFolder& folder, RunState state, const std::string& message) noexcept {
  try {
    // In the run's log alone: whoever called gets the exception, and would read the message twice.
    folder.note(std::string(run_state_name(state)) + ": " + message,
                state == RunState::kFailed ? LogLevel::kError : LogLevel::kInfo);
    folder.set_state(state, message);
  } catch (const std::exception&) {
  }
}

void set_image_size(Clip& clip, const RunConfig& config) {
  if (config.approx.longest_side_px > 0) clip.camera = reduced_camera(clip.camera, config.approx.longest_side_px);
}

namespace {

/// The first loss that is on and needs an input, as a JSON pointer; empty: none.
std::string loss_with(const RunConfig& config, LossInput input) {
  for (const auto& [name, stage] : config.stages) {
    for (const auto& [term, loss] : stage.losses) {
      if (needs_input(loss, input)) return child_pointer(child_pointer("/stages", name) + "/losses", term);
    }
  }
  return "";
}

std::string avatar_file(const DataSettings& data, std::size_t person) {
  return (person == 0 ? data.avatar : data.people.at(person - 1).second.avatar).string();
}

/// Reads the bodies whose vertices a loss asks for. One that the avatar was not made on is left out, which is told.
void give_bodies(const RunConfig& config, const std::string& loss, Clip& clip) {
  for (std::size_t p = 0; p < clip.people(); ++p) {
    BodyModel body = rest_body(body_of_avatar(config.body, avatar_file(config.data, p)));
    const std::string difference = difference_from(body, clip.person(p).avatar);
    if (difference.empty()) {
      clip.person(p).body = std::move(body);
    } else {
      log_warning(loss + ": the avatar's Gaussians stand for the vertices of `body`: " + difference);
    }
  }
}

/// Where a stage moves the betas, as a JSON pointer; empty: nowhere.
std::string betas_group(const RunConfig& config) {
  for (const auto& [name, stage] : config.stages) {
    if (find_entry(stage.optimize, kBetasGroup) != nullptr)
      return child_pointer(child_pointer("/stages", name) + "/optimize", kBetasGroup);
  }
  return "";
}

/// Reads how the avatar follows the betas of its body. @param group  that asks for it
void give_directions(const RunConfig& config, const std::string& group, Clip& clip) {
  const BodySettings body = body_of_avatar(config.body, config.data.avatar.string());
  const std::string difference = difference_from(rest_body(body), clip.avatar);
  if (!difference.empty())
    throw UserError(group + ": which body the avatar was made on must be known: " + difference +
                    "; set `body`, or leave the group out");
  std::vector<double> betas = body.shape;
  betas.resize(static_cast<std::size_t>(body.betas));
  clip.directions = avatar_directions(clip.avatar, body_model_of(body), betas);
}

/// A motion of SMPL-X tells other programs of whom it is; that of the program's own body has betas that mean nothing to
/// them.
void give_shapes(const RunConfig& config, Clip& clip) {
  for (std::size_t p = 0; p < clip.people(); ++p) {
    ClipPerson& person = clip.person(p);
    const std::optional<AvatarShape> shape = read_avatar_shape(avatar_file(config.data, p));
    if (!shape || shape->body != kSmplxName || !person.betas.empty()) continue;
    person.betas = shape->betas;
    person.gender = shape->gender;
  }
}

}  // namespace

Clip read_run_clip(const RunConfig& config, const std::vector<LossTerm>& losses) {
  Clip clip = read_clip(config.data);
  for (std::size_t p = 0; p < clip.people(); ++p)
    body_of_avatar(config.body, avatar_file(config.data, p));  // what they contradict each other in shows now
  warn_of_antialiasing(clip.antialiased, config.render.antialias);
  set_image_size(clip, config);
  for (const ConfigPath& file : stage_files(config, descriptions_of(losses)))
    clip.files.push_back({file.pointer, file.path});
  if (config.body.kind == BodyKind::kSmplx) clip.files.push_back({"/body/path", config.body.path});
  const std::string loss = loss_with(config, LossInput::kBodyVertices);
  if (!loss.empty()) give_bodies(config, loss, clip);
  if (clip.contacts && !loss_with(config, LossInput::kContacts).empty())
    check_contacts(*clip.contacts, clip.body ? &*clip.body : nullptr, clip.avatar.weights,
                   config.data.contacts.string());
  const std::string betas = betas_group(config);
  if (!betas.empty()) give_directions(config, betas, clip);
  give_shapes(config, clip);
  return clip;
}

namespace {

/// Color nets are of all people, or of none.
void check_color_nets(const RunConfig& config, const Clip& clip) {
  const bool has_net = clip.avatar.color_net.has_value();
  for (const ClipPerson& person : clip.others) {
    if (config.color_net.use != ColorNetUse::kAuto || person.avatar.color_net.has_value() == has_net) continue;
    throw UserError("/color_net/use: \"auto\": the avatar of " + (has_net ? person.name : clip.name) +
                    " has no color net, unlike that of " + (has_net ? clip.name : person.name) +
                    "; allowed: \"on\", a new one where there is none, or \"off\"");
  }
}

}  // namespace

void check_run_clip(const RunConfig& config, const Clip& clip) {
  check_start(config.start, clip);
  check_color_nets(config, clip);
  check_first_view(clip, config.data.camera.string());
  check_frames(config.data, clip, losses_over_masks(config));
}

RunSummary execute_run(const RunConfig& asked, const std::vector<LossTerm>& losses, const RunOptions& options) {
  HSI4D_CHECK(asked.chain.empty(), "a chain is executed by execute_chain");
  RunConfig config = asked;
  prepare_run(config);
  EarlyMessages early;
  for (const RunNote& note : run_notes(config)) {
    if (note.level < LogLevel::kInfo)
      early.keep(note.text);
    else
      log_message(note.level, note.text);
  }
  config = with_passes(config);
  RunIdentity identity;
  identity.config = resolved_config(config, descriptions_of(losses));  // without what programs outside make
  const int threads = options.threads > 0 ? options.threads : config.threads;
  on_threads(threads, [&] {
    if (!has_sources(config.sources)) return;
    look_at_run_folder(options.folder, identity.config, options.resume);  // before anything is made for nothing
    config.data = make_sources(config, motion_maker(losses, options.observer), options.observer);
  });
  Clip clip = read_run_clip(config, losses);                                           // before anything is written
  if (config.body.kind == BodyKind::kSmplx && !clip.body) body_model_of(config.body);  // what is wrong shows now
  check_run_clip(config, clip);
  std::string lens, blur;
  on_threads(threads, [&] {
    lens = estimate_lens(config, clip);
    blur = estimate_blur(config, clip);
  });
  identity.seed = config.seed;
  identity.threads = threads > 0 ? threads : thread_count();
  identity.sweep_axes = options.sweep_axes;
  identity.precision = choice_name<RunPrecision>(kRunPrecisions, config.precision);
  RunFolder folder(options.folder, identity, options.resume);
  folder.note(opening(config, clip, identity));
  early.move_to(folder);
  if (is_plate_file(config.data.scene)) folder.note(std::string("the scene is ") + kPlateText);
  if (!lens.empty()) folder.note(lens);
  if (!blur.empty()) folder.note(blur);
  return reconstruct_into(folder, config, clip, losses, options);
}

}  // namespace hsi4d
