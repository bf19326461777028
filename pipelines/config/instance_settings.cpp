#include "pipelines/config/instance_settings.h"

namespace hsi4d {

void describe(ConfigFields& f, InstanceSettings& s) {
  f.string("scene", s.scene, "Name of the scene in its benchmark");
  f.string("type", s.type, "Indoor or outdoor");
  f.string("source", s.source, "Where the scene comes from");
  f.string("object", s.object, "What moves besides the human; static: nothing");
  f.string("prompt", s.prompt, "What the human does, in the benchmark's words");
  f.path("folder", s.folder, {},
         "Folder with files named as by `hsi4d synth`; if it exists, they are the inputs that `data` does not name");
}

bool has_data(const InstanceSettings& instance) {
  std::error_code error;
  return !instance.folder.empty() && std::filesystem::is_directory(instance.folder, error);
}

void take_instance_data(const InstanceSettings& instance, DataSettings& data) {
  if (!has_data(instance)) return;
  DataSettings found = dataset_inputs(instance.folder);
  for (std::filesystem::path DataSettings::*file :
       {&DataSettings::scene, &DataSettings::avatar, &DataSettings::frames, &DataSettings::masks, &DataSettings::camera,
        &DataSettings::initial, &DataSettings::keypoints, &DataSettings::truth, &DataSettings::surface})
    if ((data.*file).empty()) data.*file = found.*file;
  if (data.objects.empty()) data.objects = std::move(found.objects);
  if (data.people.empty()) data.people = std::move(found.people);
}

}  // namespace hsi4d
