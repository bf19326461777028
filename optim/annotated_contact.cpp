#include "optim/annotated_contact.h"

#include <algorithm>

#include "optim/motion_start.h"

namespace hsi4d {

std::vector<Index> touching_rows(const AnnotatedContact& contact, const SparseWeights& weights) {
  if (contact.joints.empty()) return {contact.vertex};
  return rows_of_joints(weights, [&contact](Index joint) {
    return std::find(contact.joints.begin(), contact.joints.end(), joint) != contact.joints.end();
  });
}

}  // namespace hsi4d
