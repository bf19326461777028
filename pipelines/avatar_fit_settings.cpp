#include <cmath>

#include "core/config_file.h"
#include "pipelines/avatar_fit.h"

namespace hsi4d {

namespace {

constexpr int kMostThreads = 1024;

std::string fault_of_numbers(const std::vector<double>& numbers) {
  for (const double x : numbers) {
    if (x != std::floor(x)) return "whole numbers, counted from 0";
  }
  return "";
}

}  // namespace

std::vector<std::string> avatar_fit_groups() {
  return {"colors", "opacity_logits", "log_scales", "quats", "means", "color_net", "avatar_features"};
}

void describe(ConfigFields& f, AvatarFitSettings& s, const std::vector<LossDescription>& losses) {
  f.path("views", s.views, {.must_exist = true, .may_be_empty = false}, "views.json of the pictures").required();
  f.path("avatar", s.avatar, {.must_exist = true}, "The avatar to go on from; without: new Gaussians on the body");
  f.integer("seed", s.seed, {.min = 0}, "Seed of a new avatar, of a new color net and of the order of the views");
  f.integer("threads", s.threads, {.min = 0, .max = kMostThreads},
            "Threads; 0: one a core. Results do not depend on it");
  f.integer("gaussians", s.gaussians, {.min = 100, .max = 2000000}, "Gaussians of a new avatar");
  f.numbers("background", s.background, {.min = 0, .max = 1}, "Colour behind the human");
  f.numbers("held_cameras", s.held_cameras, {.min = 0}, "Cameras whose views are not learnt from, but measured");
  f.numbers("held_frames", s.held_frames, {.min = 0}, "Frames whose views are not learnt from, but measured");
  f.object("body", s.body, "The body of a new avatar");
  f.object("color_net", s.color_net, "How colours follow the pose");
  f.object("render", s.render, "How Gaussians become pixels");
  f.object("stage", s.stage, "What moves, and which losses count",
           [losses](ConfigFields& inner, StageSettings& stage) { describe(inner, stage, losses); });
  f.rule({"held_cameras"}, [&s] { return fault_of_numbers(s.held_cameras); });
  f.rule({"held_frames"}, [&s] { return fault_of_numbers(s.held_frames); });
}

AvatarFitSettings load_avatar_fit(const std::filesystem::path& file, const std::vector<std::string>& overrides,
                                  const std::vector<LossDescription>& losses) {
  ConfigProblems problems;
  const ConfigValue tree = load_config(file, overrides, problems);
  AvatarFitSettings settings;
  settings.file = file;
  ConfigFields fields;
  describe(fields, settings, losses);
  read_config(tree, fields, problems);
  problems.throw_if_any();
  check_groups(settings.stage, avatar_fit_groups(), file.string() + ": /stage/optimize");
  return settings;
}

}  // namespace hsi4d
