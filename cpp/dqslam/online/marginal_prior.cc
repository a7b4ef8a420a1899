// What an object's observations say from poses that are constant: a Gaussian on the object.
#include <algorithm>

#include "dqslam/online/linearize.h"

namespace dqslam::online {
namespace {

// What is kept is linearized anew when it has grown by this factor.
constexpr double kGrowth = 1.25;

// Adds observations [first, last) of an object.
template <typename Pose>
void AddTo(
    const History<Pose>& history, const Object& object, int first, int last, GaussianPrior* prior) {
  const Vector9d d = object.center_shape - prior->origin;
  LinearizedObservation<Pose> linear;
  for (int i = first; i < last; ++i) {
    const Observation& one = history.observations[object.observations[i]];
    Linearize(history.model,
              history.StationAt(one.pose),
              one,
              object.center_shape,
              EdgeResidual::kBox,
              &linear);
    const Matrix9d H = linear.by_object.transpose() * linear.by_object;
    const Vector9d g = linear.by_object.transpose() * linear.residual;
    prior->H += H;
    prior->g += g - H * d;
    prior->cost += linear.cost - g.dot(d) + 0.5 * d.dot(H * d);
  }
}

// The number of an object's observations from poses before `pose`.
template <typename Pose>
int CountBefore(const History<Pose>& history, const Object& object, int pose) {
  const std::vector<int>& rows = object.observations;
  const auto end = std::lower_bound(rows.begin(), rows.end(), history.ObservationsBefore(pose));
  return static_cast<int>(end - rows.begin());
}

}  // namespace

template <typename Pose>
int History<Pose>::UpdateMarginalPrior(int begin, Object* object) const {
  const int last = CountBefore(*this, *object, begin);
  int first = object->marginalized;
  if (!object->is_stale && last == first) return 0;
  if (object->is_stale || last > kGrowth * object->relinearized) {
    const int old = object->num_settled;
    if (old > last) object->Unsettle();
    if (object->num_settled == 0) {
      object->settled = GaussianPrior();
      object->settled.origin = object->center_shape;
    }
    const int settles =
        std::min(CountBefore(*this, *object, std::max(num_poses() - settling, 0)), last);
    if (settles > object->num_settled) {
      AddTo(*this, *object, object->num_settled, settles, &object->settled);
      object->num_settled = settles;
    }
    first = object->num_settled;
    object->marginal = object->settled;
    object->relinearized = last;
    object->is_stale = false;
    AddTo(*this, *object, first, last, &object->marginal);
    object->marginalized = last;
    return last - std::min(old, first);
  }
  AddTo(*this, *object, first, last, &object->marginal);
  object->marginalized = last;
  return last - first;
}

template int History<Se2>::UpdateMarginalPrior(int, Object*) const;
template int History<Se3>::UpdateMarginalPrior(int, Object*) const;

}  // namespace dqslam::online
