#include "dqslam/online/relabel.h"

#include <algorithm>
#include <iterator>
#include <map>

#include "dqslam/online/checks.h"

namespace dqslam::online {
namespace {

// Its observations that stay and those that come, both ascending: what they leave out together and
// did not leave out before.
template <typename Pose>
Relabeled LongestNewAbsence(const History<Pose>& history,
                            int object,
                            const std::vector<int>& stay,
                            const std::vector<int>& all) {
  Relabeled changed{object, 0, 0};
  for (size_t i = 1; i < all.size(); ++i) {
    const int last = history.observations[all[i - 1]].pose,
              back = history.observations[all[i]].pose;
    const bool is_old = !stay.empty() && stay.front() < all[i] && stay.back() >= all[i];
    if (!is_old && back - last > changed.back - changed.last) {
      changed.last = last;
      changed.back = back;
    }
  }
  return changed;
}

}  // namespace

template <typename Pose>
void CheckLabels(const NewLabels& given, const History<Pose>& history) {
  const int observations = static_cast<int>(history.observations.size());
  const int objects = static_cast<int>(history.objects.size());
  const Eigen::Index born = given.log_size_mean.size();
  if (given.object.size() != given.observation.size()) {
    throw std::invalid_argument("object: expected one for each observation");
  }
  CheckShape("ellipsoid", given.ellipsoid, born, kLandmarkSize);
  CheckSizes(given.log_size_mean, given.log_size_sigma);
  for (Eigen::Index row = 0; row < born; ++row) {
    // Finite logarithms may still be axes of infinite length, or of none.
    const Vector9d center_shape = CenterShapeFromEllipsoid(given.ellipsoid.row(row).transpose());
    if (!center_shape.allFinite() || !(ShapeOf(center_shape.data()).determinant() > 0)) {
      FailAt("ellipsoid", row, "not a finite ellipsoid");
    }
  }
  std::vector<bool> seen(born, false);
  for (Eigen::Index row = 0; row < given.observation.size(); ++row) {
    const int observation = given.observation[row], object = given.object[row];
    if (observation < 0 || observation >= observations)
      FailAt("observation", row, "no such observation");
    if (!history.observations[observation].is_box)
      FailAt("observation", row, "is a position, not a box");
    if (object < -1 || object >= objects + born) FailAt("object", row, "no such object");
    if (object >= objects) seen[object - objects] = true;
  }
  CheckDistinct("observation", given.observation);
  const auto unseen = std::find(seen.begin(), seen.end(), false);
  if (unseen != seen.end()) {
    FailAt("ellipsoid", unseen - seen.begin(), "the new object is not seen");
  }
}

template <typename Pose>
std::vector<Relabeled> Relabel(const NewLabels& given, History<Pose>* history) {
  for (Eigen::Index row = 0; row < given.log_size_mean.size(); ++row) {
    Object object;
    object.center_shape = CenterShapeFromEllipsoid(given.ellipsoid.row(row).transpose());
    object.size = {given.log_size_mean[row], given.log_size_sigma[row]};
    history->objects.push_back(object);
  }
  std::map<int, std::vector<int>>
      coming;  // observations by object; none for one that only loses some
  for (Eigen::Index row = 0; row < given.observation.size(); ++row) {
    Observation& observation = history->observations[given.observation[row]];
    if (observation.object == given.object[row]) continue;
    if (!observation.Waits()) coming[observation.object];
    observation.object = given.object[row];
    if (!observation.Waits()) coming[observation.object].push_back(given.observation[row]);
  }
  std::vector<Relabeled> changed;
  for (auto& [row, come] : coming) {
    Object& object = history->objects[row];
    std::sort(come.begin(), come.end());
    std::vector<int> stay, all;
    const auto is_own = [&, own = row](int observation) {
      return history->observations[observation].object == own;
    };
    std::copy_if(
        object.observations.begin(), object.observations.end(), std::back_inserter(stay), is_own);
    std::merge(stay.begin(), stay.end(), come.begin(), come.end(), std::back_inserter(all));
    object.observations = all;
    object.is_stale = true;
    changed.push_back(LongestNewAbsence(*history, row, stay, all));
  }
  return changed;
}

#define DQSLAM_INSTANTIATE(Pose)                                           \
  template void CheckLabels<Pose>(const NewLabels&, const History<Pose>&); \
  template std::vector<Relabeled> Relabel<Pose>(const NewLabels&, History<Pose>*)
DQSLAM_INSTANTIATE(Se2);
DQSLAM_INSTANTIATE(Se3);

}  // namespace dqslam::online
