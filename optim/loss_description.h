// What a config needs to know of a loss term: its name, one line about it, and its own settings.
#pragma once

#include <algorithm>
#include <any>
#include <functional>
#include <string>
#include <string_view>
#include <typeinfo>
#include <utility>
#include <vector>

#include "core/check.h"
#include "core/config.h"

namespace hsi4d {

/// What a loss term reads, without which it is off: the image and nothing else; the body's pose or motion; objects, or
/// the body, and the image.
enum class LossNeeds { kImages, kBody, kObjects, kBodyInImage };

/// What a term reads once from its settings; see LossDescription::prepare.
using PrepareLoss = std::any (*)(const std::any& settings);

/// The inputs made on demand (kReads… in optim/loss_term.h) that a term reads with these settings.
using LossReads = std::function<std::vector<std::string>(const std::any& settings)>;

/// A loss term as configs and `hsi4d list losses` see it. Made by describe_loss.
struct LossDescription {
  std::string name;     ///< the key in a stage's `losses`
  std::string summary;  ///< one line
  std::any defaults;    ///< its own settings before anything is read; empty for a term that has none
  void (*describe_settings)(ConfigFields&, std::any&) = nullptr;
  LossReads reads = {};           ///< made by reading() of optim/loss_term.h. Null: no such input
  PrepareLoss prepare = nullptr;  ///< reads the files that the settings name, say: once, before a run writes anything.
                                  ///< What it returns is recorded from in place of the settings. Null: nothing to do
  double weight = 1;              ///< the default
  LossNeeds needs = LossNeeds::kImages;
};

/// A loss term without settings of its own.
inline LossDescription describe_loss(std::string name, std::string summary) {
  LossDescription loss;
  loss.name = std::move(name);
  loss.summary = std::move(summary);
  return loss;
}

/// A loss term with its own settings: a struct with `void describe(ConfigFields&, Settings&)` beside it.
template <class Settings>
LossDescription describe_loss(std::string name, std::string summary, Settings defaults = {}) {
  LossDescription loss = describe_loss(std::move(name), std::move(summary));
  loss.defaults = std::move(defaults);
  loss.describe_settings = [](ConfigFields& fields, std::any& settings) {
    describe(fields, *std::any_cast<Settings>(&settings));
  };
  return loss;
}

/// What a term is recorded from: what it prepares of its settings, or the settings. Throws what `prepare` throws.
inline std::any prepared_loss(PrepareLoss prepare, const std::any& settings) {
  return prepare != nullptr ? prepare(settings) : settings;
}

/// One entry of a stage's `losses`: the weight, and the term's own settings beside it.
struct LossSettings {
  double weight = 1;
  std::any own;
  void (*describe_own)(ConfigFields&, std::any&) = nullptr;
  PrepareLoss prepare = nullptr;
  LossNeeds needs = LossNeeds::kImages;
  std::any prepared;  ///< of `own`, by prepare_losses (optim/stage_settings.h); empty before
  LossReads reads = {};

  /// The term's own settings. Throws InternalError when the term has others than `Settings`.
  template <class Settings>
  const Settings& own_as() const {
    const Settings* settings = std::any_cast<Settings>(&own);
    HSI4D_CHECK(settings != nullptr,
                std::string("the settings of this loss are not of type ") + typeid(Settings).name());
    return *settings;
  }
};

/// Whether a term with these settings is on and reads the input, one that is made on demand.
inline bool reads_input(const LossSettings& loss, std::string_view input) {
  if (loss.weight == 0 || !loss.reads) return false;
  const std::vector<std::string> inputs = loss.reads(loss.own);
  return std::find(inputs.begin(), inputs.end(), input) != inputs.end();
}

/// The settings of a term before anything is read.
inline LossSettings default_settings(const LossDescription& loss) {
  return {loss.weight, loss.defaults, loss.describe_settings, loss.prepare, loss.needs, {}, loss.reads};
}

/// Describes the weight and the term's own settings.
inline void describe(ConfigFields& fields, LossSettings& settings) {
  fields.number("weight", settings.weight, {.min = 0}, "Factor in the stage's sum; 0: off");
  if (settings.describe_own) settings.describe_own(fields, settings.own);
}

}  // namespace hsi4d
