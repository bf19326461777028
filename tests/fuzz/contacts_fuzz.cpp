// Any bytes as a file of annotated contacts.
#include <string>
#include <string_view>

#include "pipelines/input/contacts.h"
#include "tests/fuzz/fuzz.h"

namespace hsi4d::fuzz::contacts_fuzz {

const ContactNames kKnown = {{"can"}, 5};

std::vector<Bytes> corpus() {
  constexpr std::string_view kParts = R"({"format": "hsi4d contacts", "version": 1, "contacts": [
  {"frame": 4, "body": "right_hand", "object": "can", "point": [0, -1.5, 1e-1], "weight": 0.5},
  {"frame": 0, "body": "head", "object": "can"}]})",
                             kVertex = R"({"format": "hsi4d contacts", "version": 1, "contacts": [
  {"frame": 1, "vertex": 12, "scene": [1, 2, 3]}]})";
  return {Bytes(kParts.begin(), kParts.end()), Bytes(kVertex.begin(), kVertex.end())};
}

bool accepts(std::span<const uint8_t> file) {
  return is_read([&] {
    for (const AnnotatedContact& contact :
         decode_contacts(std::string(file.begin(), file.end()), "fuzz.json", kKnown)) {
      HSI4D_CHECK(contact.frame >= 0 && contact.frame < kKnown.frames, "an accepted frame that is not there");
      HSI4D_CHECK(contact.object.value_or(0) == 0, "an accepted object that is not there");
      HSI4D_CHECK(contact.object.has_value() || contact.place.has_value(), "a contact with nothing");
      HSI4D_CHECK(!contact.place || contact.place->allFinite(), "an accepted place is not finite");
      HSI4D_CHECK(contact.weight > 0 && contact.vertex >= 0, "an accepted number is out of range");
    }
  });
}

const Target target("contacts", corpus, accepts);

}  // namespace hsi4d::fuzz::contacts_fuzz
