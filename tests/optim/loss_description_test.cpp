#include "optim/loss_description.h"

#include <catch2/catch.hpp>

#include "core/config_file.h"

namespace loss_description_test {

using namespace hsi4d;

namespace smooth {
struct Settings {
  double width = 0.5;
};
void describe(ConfigFields& f, Settings& s) { f.number("width", s.width, {.above = 0}, "Width"); }
}  // namespace smooth

TEST_CASE("a loss brings its own settings beside the weight") {
  const LossDescription loss = describe_loss("smooth", "Makes it smooth", smooth::Settings{0.25});
  LossSettings settings = default_settings(loss);
  CHECK(settings.own_as<smooth::Settings>().width == 0.25);
  const LossSettings untouched = settings;
  ConfigFields fields;
  describe(fields, settings);
  ConfigProblems problems;
  read_config(load_config_text(R"({"weight": 2, "width": 3})", "a.json", "", {}, problems), fields, problems);
  problems.throw_if_any();
  CHECK(settings.weight == 2);
  CHECK(settings.own_as<smooth::Settings>().width == 3);
  CHECK(untouched.own_as<smooth::Settings>().width == 0.25);  // a copy has settings of its own
  CHECK_THROWS_AS(settings.own_as<int>(), InternalError);
}

TEST_CASE("a loss without settings has a weight only") {
  const LossDescription loss = describe_loss("plain", "Plain");
  LossSettings settings = default_settings(loss);
  ConfigFields fields;
  describe(fields, settings);
  CHECK(fields.names() == std::vector<std::string>{"weight"});
  CHECK_THROWS_AS(settings.own_as<smooth::Settings>(), InternalError);
}

}  // namespace loss_description_test
