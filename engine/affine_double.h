// Affine maps in double, for the build: node matrices are composed, inverted and bounded in double and rounded to
// float once. Called by the scene build. Pure; plain values.
#pragma once

#include <array>
#include <cmath>

#include "treelets/vector.h"

namespace shoal {

using Vec3d = std::array<double, 3>;

/// x -> linear * x + translation. Columns as in glTF.
struct AffineDouble {
  Vec3d column[3] = {{1, 0, 0}, {0, 1, 0}, {0, 0, 1}};
  Vec3d translation = {0, 0, 0};

  Vec3d vector(const Vec3d& v) const {
    Vec3d r;
    for (int i = 0; i < 3; ++i) r[i] = column[0][i] * v[0] + column[1][i] * v[1] + column[2][i] * v[2];
    return r;
  }
  Vec3d point(const Vec3d& p) const {
    Vec3d r = vector(p);
    for (int i = 0; i < 3; ++i) r[i] += translation[i];
    return r;
  }
};

/// Of a column-major matrix whose last row is 0 0 0 1.
AffineDouble affine_of(const std::array<double, 16>& matrix);
AffineDouble multiply(const AffineDouble& a, const AffineDouble& b);
double determinant(const AffineDouble& a);
/// The linear part's cofactors, as columns, with no translation: determinant * inverse transpose, defined for
/// singular maps too. It carries the normals of planes, up to sign and length.
AffineDouble cofactors(const AffineDouble& a);
/// Requires: determinant(a) != 0. The result may hold infinities when `a` is nearly singular: see finite().
AffineDouble inverse(const AffineDouble& a);
bool finite(const AffineDouble& a);
/// The greatest row sum of |a| |b|, linear parts: bounds how much errors grow through a and its inverse b.
double absolute_row_sum(const AffineDouble& a, const AffineDouble& b);

Affine3 rounded(const AffineDouble& a);
AffineDouble widened(const Affine3& a);

/// v / |v|, or zeros when v is zero or not finite.
Vec3d normalized_or_zero(const Vec3d& v);

}  // namespace shoal
