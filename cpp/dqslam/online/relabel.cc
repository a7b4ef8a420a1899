#include "dqslam/online/relabel.h"

#include <algorithm>
#include <iterator>
#include <map>

#include "dqslam/problem/checks.h"

namespace dqslam::online {
namespace {

// Of all observations of an object, ascending, of which it kept `kept`: the longest absence between
// two of them that did not lie between two of these.
template <typename Pose>
Relabeled LongestNewAbsence(const History<Pose>& history,
                            int object,
                            const std::vector<int>& kept,
                            const std::vector<int>& all) {
  Relabeled changed{object, 0, 0};
  for (size_t i = 1; i < all.size(); ++i) {
    const int last = history.observations[all[i - 1]].pose;
    const int back = history.observations[all[i]].pose;
    const bool is_old = !kept.empty() && kept.front() < all[i] && kept.back() >= all[i];
    if (!is_old && back - last > changed.back - changed.last) {
      changed.last = last;
      changed.back = back;
    }
  }
  return changed;
}

template <typename Pose>
void Check(const NewLabels& given, const History<Pose>& history) {
  const Eigen::Index rows = given.observation.size(), born = given.log_size_mean.size();
  CheckIds("observation", given.observation, rows, history.num_observations());
  CheckDistinct("observation", given.observation);
  CheckIds("object", given.object, rows, history.num_objects() + born, -1);
  for (Eigen::Index row = 0; row < rows; ++row) {
    if (!history.observations[given.observation[row]].IsBox())
      FailAt("observation", row, "is a position, not a box");
  }
  CheckSizePriors(given.log_size_mean, given.log_size_sigma, born);
  CheckTable("ellipsoid", given.ellipsoid, born, kLandmarkSize);
  for (Eigen::Index row = 0; row < born; ++row) {
    // Finite logarithms may still be axes of infinite length, or of none.
    const Vector9d center_shape = CenterShapeFromEllipsoid(given.ellipsoid.row(row).transpose());
    if (!center_shape.allFinite() || !(ShapeOf(center_shape.data()).determinant() > 0)) {
      FailAt("ellipsoid", row, "not a finite ellipsoid");
    }
  }
  CheckShown("ellipsoid", born, given.object, history.num_objects());
}

}  // namespace

template <typename Pose>
std::vector<Relabeled> Relabel(const NewLabels& given, History<Pose>* history) {
  Check(given, *history);
  for (Eigen::Index row = 0; row < given.log_size_mean.size(); ++row) {
    Object object;
    object.center_shape = CenterShapeFromEllipsoid(given.ellipsoid.row(row).transpose());
    object.size = {given.log_size_mean[row], given.log_size_sigma[row]};
    history->objects.push_back(object);
  }
  std::map<int, std::vector<int>> added;  // to each object; none to one that only loses some
  for (Eigen::Index row = 0; row < given.observation.size(); ++row) {
    Observation& observation = history->observations[given.observation[row]];
    if (observation.object == given.object[row]) continue;
    if (observation.is_deferred) history->Use(given.observation[row]);
    if (observation.object >= 0) added[observation.object];
    observation.object = given.object[row];
    if (observation.object >= 0) added[observation.object].push_back(given.observation[row]);
  }
  std::vector<Relabeled> changed;
  for (auto& [row, rows] : added) {
    Object& object = history->objects[row];
    std::sort(rows.begin(), rows.end());
    std::vector<int> kept, all;
    const auto is_own = [&, object_row = row](int observation) {
      return history->observations[observation].object == object_row;
    };
    std::copy_if(
        object.observations.begin(), object.observations.end(), std::back_inserter(kept), is_own);
    std::merge(kept.begin(), kept.end(), rows.begin(), rows.end(), std::back_inserter(all));
    object.observations = all;
    object.Unsettle();
    changed.push_back(LongestNewAbsence(*history, row, kept, all));
  }
  return changed;
}

template std::vector<Relabeled> Relabel<Se2>(const NewLabels&, History<Se2>*);
template std::vector<Relabeled> Relabel<Se3>(const NewLabels&, History<Se3>*);

}  // namespace dqslam::online
