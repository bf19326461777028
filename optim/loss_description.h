// What a config needs to know of a loss term: its name, one line about it, and its own settings.
#pragma once

#include <any>
#include <string>
#include <typeinfo>
#include <utility>
#include <vector>

#include "core/check.h"
#include "core/config.h"

namespace hsi4d {

/// A loss term as configs and `hsi4d list losses` see it. Made by describe_loss.
struct LossDescription {
  std::string name;     ///< the key in a stage's `losses`
  std::string summary;  ///< one line
  std::any defaults;    ///< its own settings before anything is read; empty for a term that has none
  void (*describe_settings)(ConfigFields&, std::any&) = nullptr;
  std::vector<std::string> reads = {};  ///< inputs that are made on demand (LossTerm reading())
};

/// A loss term without settings of its own.
inline LossDescription describe_loss(std::string name, std::string summary) {
  return {std::move(name), std::move(summary), {}, nullptr};
}

/// A loss term with its own settings: a struct with `void describe(ConfigFields&, Settings&)` beside it.
template <class Settings>
LossDescription describe_loss(std::string name, std::string summary, Settings defaults = {}) {
  return {std::move(name), std::move(summary), std::move(defaults),
          [](ConfigFields& fields, std::any& settings) { describe(fields, *std::any_cast<Settings>(&settings)); }};
}

/// One entry of a stage's `losses`: the weight, and the term's own settings beside it.
struct LossSettings {
  double weight = 1;
  std::any own;
  void (*describe_own)(ConfigFields&, std::any&) = nullptr;

  /// The term's own settings. Throws InternalError when the term has others than `Settings`.
  template <class Settings>
  const Settings& own_as() const {
    const Settings* settings = std::any_cast<Settings>(&own);
    HSI4D_CHECK(settings != nullptr,
                std::string("the settings of this loss are not of type ") + typeid(Settings).name());
    return *settings;
  }
};

/// Describes the weight and the term's own settings.
inline void describe(ConfigFields& fields, LossSettings& settings) {
  fields.number("weight", settings.weight, {.min = 0}, "Factor of this term in the stage's sum; 0 switches it off");
  if (settings.describe_own) settings.describe_own(fields, settings.own);
}

}  // namespace hsi4d
