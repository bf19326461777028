// Config section `instance`: what of a benchmark a config is about, and where its data goes.
#pragma once

#include <filesystem>
#include <string>

#include "core/config.h"
#include "pipelines/config/data_settings.h"

namespace hsi4d {

/// An instance of AnyInteraction: a scene, what is asked for, and a folder for who has the data.
struct InstanceSettings {
  std::string scene;   ///< its name in the benchmark
  std::string type;    ///< indoor, outdoor
  std::string source;  ///< where the scene comes from
  std::string object;  ///< what moves; "static": nothing does
  std::string prompt;
  std::filesystem::path folder;  ///< laid out as `hsi4d synth` lays a dataset out; it may be missing
};

/// Describes the section.
void describe(ConfigFields& fields, InstanceSettings& settings);

/// Whether the folder is there.
bool has_data(const InstanceSettings& instance);

/// Where the folder is there: its files, for those that `data` does not name.
void take_instance_data(const InstanceSettings& instance, DataSettings& data);

}  // namespace hsi4d
