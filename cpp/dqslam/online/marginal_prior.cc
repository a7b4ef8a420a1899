// What an object's observations say from poses that are constant: a Gaussian on the object.
#include <algorithm>

#include "dqslam/online/linearize.h"

namespace dqslam::online {
namespace {

// What is kept is linearized anew when it has grown by this factor.
constexpr double kGrowth = 1.25;

}  // namespace

template <typename Pose>
int History<Pose>::UpdateMarginalPrior(int begin, Object* object) const {
  const std::vector<int>& rows = object->observations;
  int first = object->is_stale ? 0 : object->marginalized;
  const auto end = std::lower_bound(rows.begin() + first, rows.end(), ObservationsBefore(begin));
  const int last = static_cast<int>(end - rows.begin());
  if (!object->is_stale && last == first) return 0;
  if (object->is_stale || last > kGrowth * object->relinearized) {
    first = 0;
    object->marginal = GaussianPrior();
    object->marginal.origin = object->center_shape;
    object->relinearized = last;
    object->is_stale = false;
  }
  GaussianPrior& marginal = object->marginal;
  const Vector9d d = object->center_shape - marginal.origin;
  LinearizedObservation<Pose> linear;
  for (int i = first; i < last; ++i) {
    const Observation& one = observations[rows[i]];
    Linearize(model, StationAt(one.pose), one, object->center_shape, EdgeResidual::kBox, &linear);
    const Matrix9d H = linear.by_object.transpose() * linear.by_object;
    const Vector9d g = linear.by_object.transpose() * linear.residual;
    marginal.H += H;
    marginal.g += g - H * d;
    marginal.cost += linear.cost - g.dot(d) + 0.5 * d.dot(H * d);
  }
  object->marginalized = last;
  return last - first;
}

template int History<Se2>::UpdateMarginalPrior(int, Object*) const;
template int History<Se3>::UpdateMarginalPrior(int, Object*) const;

}  // namespace dqslam::online
