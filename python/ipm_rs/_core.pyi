"""The Rust core. Import its names from `ipm_rs`."""

from os import PathLike
from typing import Any, BinaryIO, Literal, Protocol, SupportsIndex, TypeAlias, TypedDict, TypeVar, final, overload

import numpy as np
from numpy.typing import ArrayLike, DTypeLike, NDArray

from collections.abc import Mapping, Sequence

from ipm_rs.layers import Layers

__all__ = [
    "BevGrid",
    "BrownConrady",
    "Camera",
    "Cylindrical",
    "Division",
    "DoubleSphere",
    "Equirectangular",
    "Eucm",
    "FTheta",
    "Fov",
    "HeightMap",
    "InverseBrownConrady",
    "KannalaBrandt",
    "Lut",
    "Mei",
    "Ocam",
    "PixelRays",
    "Plane",
    "RadialPolynomial",
    "ThinPrismFisheye",
    "_RigTable",
    "_checksum",
    "_mosaic_add",
    "_mosaic_merge",
    "_mosaic_shown",
    "_mosaic_shows",
    "_mosaic_windows",
    "_refine_differences",
    "_refine_normal",
    "_refine_shown",
    "__version__",
    "cpu_info",
    "decode_carla_depth",
    "depth_to_lidar",
    "depth_to_local_point_cloud",
    "encode_carla_depth",
    "flip_handedness",
    "flip_handedness_euler",
    "flip_handedness_pose",
    "flip_handedness_rotation",
    "get_num_threads",
    "homography_from_points",
    "points_from_depth",
    "rasterize",
    "rasterize_boxes",
    "rasterize_polygons",
    "remap",
    "render_points",
    "rotation_from_euler",
    "set_num_threads",
    "vanishing_point",
    "warp_perspective",
]

__version__: str

class _DLPack(Protocol):
    def __dlpack__(self) -> Any: ...
    def __dlpack_device__(self) -> tuple[Any, Any]: ...

_Out = TypeVar("_Out", bound=NDArray[Any] | _DLPack | memoryview)

class _CpuInfo(TypedDict):
    version: str
    isa: str
    available_isas: list[str]
    cpu_features: list[str]
    threads: int
    platform: str
    build: str

_BorderMode: TypeAlias = Literal["constant", "replicate", "reflect", "reflect_101", "wrap"]
_Lens: TypeAlias = (
    BrownConrady
    | KannalaBrandt
    | Mei
    | DoubleSphere
    | Eucm
    | RadialPolynomial
    | Ocam
    | FTheta
    | Fov
    | Division
    | InverseBrownConrady
    | ThinPrismFisheye
    | Cylindrical
    | Equirectangular
)

@final
class BrownConrady:
    """Brown-Conrady, also called plumb_bob and radtan: OpenCV's lens. Immutable, comparable, hashable, picklable.

    With `x = X / Z`, `y = Y / Z`, `s = x^2 + y^2`, `L = (1 + k1 s + k2 s^2 + k3 s^3) / (1 + k4 s + k5 s^2 + k6 s^3)`:
    `x' = x L + 2 p1 x y + p2 (s + 2 x^2) + s1 s + s2 s^2`, `y' = y L + p1 (s + 2 y^2) + 2 p2 x y + s3 s + s4 s^2`, then
    the homography of a tilted sensor; `pixel = K (x', y', 1)`. Source: OpenCV, calib3d, "Detailed Description".

    The domain is the largest circle around the axis in which the image does not fold back: up to the first zero of the
    radial derivative, or of the Jacobian where tangential, prism or tilt terms bend it.
    """

    def __new__(cls, coefficients: ArrayLike, *, max_angle: float | None = None) -> BrownConrady:
        """A lens from its coefficients.

        Args:
            coefficients: k1, k2, p1, p2[, k3[, k4, k5, k6[, s1, s2, s3, s4[, tau_x, tau_y]]]]: 4, 5, 8, 12 or 14 of them in
                the order of OpenCV and ROS.
            max_angle: radians from the axis beyond which nothing is seen, where a lens's calibration or image circle ends
                before its own limit; None for that limit.

        Raises:
            CalibrationError: a number is not finite or cannot be right, the image folds back within 0.001 rad
                of the axis, or their count is another.
            ArgumentError, ArgumentTypeError: no list of numbers.
        """
    @property
    def coefficients(self) -> list[float]:
        """As given."""
    @property
    def max_angle(self) -> float:
        """The validity limit, radians from the axis: directions beyond it have no image."""
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]: ...

@final
class KannalaBrandt:
    """Kannala-Brandt with four coefficients: equidistant, fisheye, KB4. Immutable, comparable, hashable, picklable.

    With `r = sqrt(X^2 + Y^2)`, `t = atan2(r, Z)`: `rho = t (1 + k1 t^2 + k2 t^4 + k3 t^6 + k4 t^8)`,
    `pixel = K (X rho / r, Y rho / r, 1)`. It holds beyond 90 degrees, where `cv2.fisheye` does not. Source: Kannala and
    Brandt 2006; OpenCV, calib3d, "Fisheye camera model". The domain ends where rho stops growing.
    """

    def __new__(cls, coefficients: ArrayLike, *, max_angle: float | None = None) -> KannalaBrandt:
        """A lens from its coefficients.

        Args:
            coefficients: k1, k2, k3, k4.
            max_angle: radians from the axis beyond which nothing is seen, where a lens's calibration or image circle ends
                before its own limit; None for that limit.

        Raises:
            CalibrationError: a number is not finite or cannot be right, the image folds back within 0.001 rad
                of the axis, or they are not 4.
            ArgumentError, ArgumentTypeError: no list of numbers.
        """
    @property
    def coefficients(self) -> list[float]:
        """As given."""
    @property
    def max_angle(self) -> float:
        """The validity limit, radians from the axis: directions beyond it have no image."""
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]: ...

@final
class Mei:
    """The unified omnidirectional camera with radtan, as in KITTI-360, Kalibr (`omni`) and `cv2.omnidir`. Immutable,
    comparable, hashable, picklable.

    `(x, y) = (X, Y) / (Z + xi |P|)`, then k1, k2, p1, p2 as in `BrownConrady`, then K. Source: Mei and Rives 2007. The
    domain is `Z > -w |P|`, `w = 1 / xi` if xi > 1 else xi, and ends sooner where radtan folds back.
    """

    def __new__(cls, xi: float, coefficients: ArrayLike, *, max_angle: float | None = None) -> Mei:
        """A lens from its parameters.

        Args:
            xi: distance of the projection centre from the sphere's, at least 0.
            coefficients: k1, k2, p1, p2.
            max_angle: radians from the axis beyond which nothing is seen, where a lens's calibration or image circle ends
                before its own limit; None for that limit.

        Raises:
            CalibrationError: a number is not finite or cannot be right, the image folds back within 0.001 rad
                of the axis, or the coefficients are not 4.
            ArgumentError, ArgumentTypeError: no list of numbers.
        """
    @property
    def xi(self) -> float:
        """Distance of the projection centre from the sphere's."""
    @property
    def coefficients(self) -> list[float]:
        """As given."""
    @property
    def max_angle(self) -> float:
        """The validity limit, radians from the axis: directions beyond it have no image."""
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]: ...

@final
class DoubleSphere:
    """Double sphere, basalt's and Kalibr's `ds`. Immutable, comparable, hashable, picklable.

    `d1 = |P|`, `k = xi d1 + Z`, `d2 = sqrt(X^2 + Y^2 + k^2)`, `m = (X, Y) / (alpha d2 + (1 - alpha) k)`, `pixel = K (m, 1)`.
    Source: Usenko, Demmel and Cremers 2018, whose domain it has: `Z > -w2 d1`.
    """

    def __new__(cls, xi: float, alpha: float, *, max_angle: float | None = None) -> DoubleSphere:
        """A lens from its parameters.

        Args:
            xi: distance of the spheres' centres, above -1 and up to 1.
            alpha: from 0 to 1.
            max_angle: radians from the axis beyond which nothing is seen, where a lens's calibration or image circle ends
                before its own limit; None for that limit.

        Raises:
            CalibrationError: a number is not finite or cannot be right, the image folds back within 0.001 rad of the axis.
            ArgumentError, ArgumentTypeError: no list of numbers.
        """
    @property
    def xi(self) -> float:
        """Distance of the spheres' centres."""
    @property
    def alpha(self) -> float:
        """The pinhole's shift is alpha / (1 - alpha)."""
    @property
    def max_angle(self) -> float:
        """The validity limit, radians from the axis: directions beyond it have no image."""
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]: ...

@final
class Eucm:
    """The enhanced unified camera model, Kalibr's and basalt's `eucm`. Immutable, comparable, hashable, picklable.

    `d = sqrt(beta (X^2 + Y^2) + Z^2)`, `m = (X, Y) / (alpha d + (1 - alpha) Z)`, `pixel = K (m, 1)`. Source: Khomutenko,
    Garcia and Martinet 2016. The domain is `Z > -w d`, `w = alpha / (1 - alpha)` up to alpha = 1/2, its inverse beyond.
    """

    def __new__(cls, alpha: float, beta: float, *, max_angle: float | None = None) -> Eucm:
        """A lens from its parameters.

        Args:
            alpha: from 0 to 1.
            beta: above 0.
            max_angle: radians from the axis beyond which nothing is seen, where a lens's calibration or image circle ends
                before its own limit; None for that limit.

        Raises:
            CalibrationError: a number is not finite or cannot be right, the image folds back within 0.001 rad of the axis.
            ArgumentError, ArgumentTypeError: no list of numbers.
        """
    @property
    def alpha(self) -> float:
        """The pinhole's shift is alpha / (1 - alpha)."""
    @property
    def beta(self) -> float:
        """The ellipsoid's shape."""
    @property
    def max_angle(self) -> float:
        """The validity limit, radians from the axis: directions beyond it have no image."""
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]: ...

@final
class RadialPolynomial:
    """WoodScape's `radial_poly`, a polynomial of the angle in pixels. Immutable, comparable, hashable, picklable.

    With `r = sqrt(X^2 + Y^2)`, `t = atan2(r, Z)`: `rho = k1 t + k2 t^2 + k3 t^3 + k4 t^4` pixels,
    `pixel = K (X rho / r, Y rho / r, 1)` with `K = [[1, 0, cx], [0, aspect, cy], [0, 0, 1]]`. Source: the WoodScape data
    set. The domain ends where rho stops growing.
    """

    def __new__(cls, coefficients: ArrayLike, *, max_angle: float | None = None) -> RadialPolynomial:
        """A lens from its coefficients.

        Args:
            coefficients: k1, k2, k3, k4 in pixels; k1 above 0.
            max_angle: radians from the axis beyond which nothing is seen, where a lens's calibration or image circle ends
                before its own limit; None for that limit.

        Raises:
            CalibrationError: a number is not finite or cannot be right, the image folds back within 0.001 rad
                of the axis, or they are not 4.
            ArgumentError, ArgumentTypeError: no list of numbers.
        """
    @property
    def coefficients(self) -> list[float]:
        """As given."""
    @property
    def max_angle(self) -> float:
        """The validity limit, radians from the axis: directions beyond it have no image."""
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]: ...

@final
class Ocam:
    """Scaramuzza's polynomial of the radius, in pixels, as OCamCalib and MATLAB's `fisheyeIntrinsics` have it. Immutable,
    comparable, hashable, picklable.

    The pixel at distance rho from the centre looks along `(x, y, f(rho))`, `f = a0 + a1 rho + a2 rho^2 + ...`. This forward
    polynomial is the definition; projection inverts it to rounding (the inverse polynomial of OCamCalib's files is a fit
    of it, and is not used). Source: Scaramuzza, Martinelli and Siegwart 2006; OCamCalib's `cam2world`.

    In OCamCalib's frame x counts rows down, y columns to the right, `row = c x + d y + xc`, `column = e x + y + yc`, and z
    points out of the camera's back, so a0 < 0; MATLAB's has a0 > 0. Either sign is taken: the axis, rho = 0, looks
    forward. In the optical frame `m = (X' + e Y', d X' + c Y')`, X' to the right and Y' down, and
    `K = [[1, 0, yc], [0, 1, xc], [0, 0, 1]]`; MATLAB's 1-based xc and yc lose 1 first. The domain ends where the angle
    stops growing with rho.
    """

    def __new__(cls, polynomial: ArrayLike, affine: Sequence[float] = (1.0, 0.0, 0.0), *, max_angle: float | None = None) -> Ocam:
        """A lens from its forward polynomial.

        Args:
            polynomial: a0, a1, a2, ..., up to 12, constant first; a1 is 0 in OCamCalib's files and must be written.
            affine: (c, d, e).
            max_angle: radians from the axis beyond which nothing is seen, where a lens's calibration or image circle ends
                before its own limit; None for that limit.

        Raises:
            CalibrationError: a number is not finite or cannot be right, the image folds back within 0.001 rad of the axis.
            ArgumentError, ArgumentTypeError: no list of numbers.
        """
    @property
    def polynomial(self) -> list[float]:
        """a0, a1, a2, ... as given."""
    @property
    def affine(self) -> tuple[float, float, float]:
        """(c, d, e)."""
    @property
    def max_angle(self) -> float:
        """The validity limit, radians from the axis: directions beyond it have no image."""
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]: ...

@final
class FTheta:
    """NVIDIA's f-theta lens, a polynomial between the angle from the axis and pixels. Immutable, comparable, hashable,
    picklable.

    With `r = sqrt(X^2 + Y^2)`, `t = atan2(r, Z)`: `rho = a1 t + a2 t^2 + ...` pixels in the form "forward"
    (`angle-to-pixeldistance`, `fw_poly`), `t = a1 rho + a2 rho^2 + ...` in the form "backward" (`pixeldistance-to-angle`,
    `bw_poly`), which projection inverts to rounding. With `(x, y) = (X, Y) rho / r`: `pixel = K (c x + d y, e x + y, 1)`,
    `K = [[1, 0, cx], [0, 1, cy], [0, 0, 1]]`. Source: DriveWorks' rig format (`ftheta`). The domain ends where the polynomial
    stops growing.
    """

    def __new__(cls, polynomial: ArrayLike, form: Literal["forward", "backward"], linear: Sequence[float] = (1.0, 0.0, 0.0), *, max_angle: float | None = None) -> FTheta:
        """A lens from its polynomial.

        Args:
            polynomial: a0, a1, a2, ..., from 2 to 12, constant first; a0 is 0, a1 above 0.
            form: "forward" or "backward". A file that has both is defined by the one that it calls the reference.
            linear: (c, d, e), `linear-c`, `linear-d` and `linear-e`.
            max_angle: radians from the axis beyond which nothing is seen, where a lens's calibration or image circle ends
                before its own limit; None for that limit.

        Raises:
            CalibrationError: a number is not finite or cannot be right, the image folds back within 0.001 rad of the axis.
            ArgumentError, ArgumentTypeError: no list of numbers, or another form.
        """
    @property
    def polynomial(self) -> list[float]:
        """a0, a1, a2, ... as given."""
    @property
    def form(self) -> str:
        """"forward" or "backward"."""
    @property
    def linear(self) -> tuple[float, float, float]:
        """(c, d, e)."""
    @property
    def max_angle(self) -> float:
        """The validity limit, radians from the axis: directions beyond it have no image."""
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]: ...

@final
class Fov:
    """The field-of-view model of Devernay and Faugeras, COLMAP's `FOV`, Kalibr's `fov`, and DSO's. Immutable, comparable,
    hashable, picklable.

    With `r = sqrt(X^2 + Y^2) / Z`: `rho = atan(2 r tan(omega / 2)) / omega`, `pixel = K (X / Z rho / r, Y / Z rho / r, 1)`.
    Source: Devernay and Faugeras 2001. The domain is what lies in front of the camera, Z > 0.
    """

    def __new__(cls, omega: float, *, max_angle: float | None = None) -> Fov:
        """A lens from its parameter.

        Args:
            omega: radians, above 0 and below pi.
            max_angle: radians from the axis beyond which nothing is seen, where a lens's calibration or image circle ends
                before its own limit; None for that limit.

        Raises:
            CalibrationError: a number is not finite or cannot be right.
            ArgumentTypeError: no number.
        """
    @property
    def omega(self) -> float:
        """The parameter, radians."""
    @property
    def max_angle(self) -> float:
        """The validity limit, radians from the axis: directions beyond it have no image."""
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]: ...

@final
class Division:
    """The division model of Fitzgibbon with one parameter, COLMAP's `DIVISION`. Immutable, comparable, hashable, picklable.

    What is seen at m, `pixel = K (m, 1)`, looks along `(m, 1 + k |m|^2)`: for k < 0 also beyond 90 degrees. Source:
    Fitzgibbon 2001. The domain ends where the angle stops growing with |m|. With more terms it is an `Ocam`, in pixels.
    """

    def __new__(cls, k: float, *, max_angle: float | None = None) -> Division:
        """A lens from its parameter.

        Args:
            k: negative for barrel distortion; in K's focal lengths, so one of pixels is times the square of it.
            max_angle: radians from the axis beyond which nothing is seen, where a lens's calibration or image circle ends
                before its own limit; None for that limit.

        Raises:
            CalibrationError: a number is not finite or cannot be right, the image folds back within 0.001 rad of the axis.
            ArgumentTypeError: no number.
        """
    @property
    def k(self) -> float:
        """The parameter."""
    @property
    def max_angle(self) -> float:
        """The validity limit, radians from the axis: directions beyond it have no image."""
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]: ...

@final
class InverseBrownConrady:
    """Brown-Conrady from the image to the ray, RealSense's `INVERSE_BROWN_CONRADY`. Immutable, comparable, hashable,
    picklable.

    What is seen at m, `pixel = K (m, 1)`, looks along `(B(m), 1)`, B the formula of `BrownConrady` with k1, k2, p1, p2, k3;
    projection inverts it to rounding. Source: librealsense, `rs_types.h`, by which such coefficients undistort. The
    domain is the largest cone within what B makes of the circle in which it is one-to-one.

    Where coefficients called so were fitted to distort, as by OpenCV, they belong into a `BrownConrady`: librealsense's own
    functions take these too in that sense. Of a straight edge only the right one makes a straight line.
    """

    def __new__(cls, coefficients: ArrayLike, *, max_angle: float | None = None) -> InverseBrownConrady:
        """A lens from its coefficients.

        Args:
            coefficients: k1, k2, p1, p2[, k3].
            max_angle: radians from the axis beyond which nothing is seen, where a lens's calibration or image circle ends
                before its own limit; None for that limit.

        Raises:
            CalibrationError: a number is not finite or cannot be right, the image folds back within 0.001 rad
                of the axis, or they are not 4 or 5.
            ArgumentError, ArgumentTypeError: no list of numbers.
        """
    @property
    def coefficients(self) -> list[float]:
        """As given."""
    @property
    def max_angle(self) -> float:
        """The validity limit, radians from the axis: directions beyond it have no image."""
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]: ...

@final
class ThinPrismFisheye:
    """A fisheye with tangential and thin prism terms: COLMAP's `THIN_PRISM_FISHEYE` and `RAD_TAN_THIN_PRISM_FISHEYE`, which is
    Project Aria's FISHEYE624. Immutable, comparable, hashable, picklable.

    With `r = sqrt(X^2 + Y^2)`, `t = atan2(r, Z)`, `q = t (X, Y) / r`, `w = q (1 + k1 t^2 + k2 t^4 + ...)`, `s = x^2 + y^2`:
    `pixel = K (w + T, 1)`, of 8 coefficients `T = (2 p1 x y + p2 (s + 2 x^2) + sx1 s, p1 (s + 2 y^2) + 2 p2 x y + sy1 s)` of
    (x, y) = q, of 12 `T = (p1 (s + 2 x^2) + 2 p2 x y + s1 s + s2 s^2, 2 p1 x y + p2 (s + 2 y^2) + s3 s + s4 s^2)` of (x, y) =
    w. It holds beyond 90 degrees. Source: COLMAP, `sensor/models.h`. The domain ends where the image folds.
    """

    def __new__(cls, coefficients: ArrayLike, *, max_angle: float | None = None) -> ThinPrismFisheye:
        """A lens from its coefficients, in COLMAP's order.

        Args:
            coefficients: k1, k2, p1, p2, k3, k4, sx1, sy1; or k1 to k6 (COLMAP's k0 to k5), p1, p2 (p0, p1), s1 to s4 (s0 to s3).
            max_angle: radians from the axis beyond which nothing is seen, where a lens's calibration or image circle ends
                before its own limit; None for that limit.

        Raises:
            CalibrationError: a number is not finite or cannot be right, the image folds back within 0.001 rad
                of the axis, or they are not 8 or 12.
            ArgumentError, ArgumentTypeError: no list of numbers.
        """
    @property
    def coefficients(self) -> list[float]:
        """As given."""
    @property
    def max_angle(self) -> float:
        """The validity limit, radians from the axis: directions beyond it have no image."""
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]: ...

@final
class Cylindrical:
    """A panorama on a cylinder around the camera's y axis. Immutable, comparable, hashable, picklable.

    `pixel = K (atan2(X, Z), Y / sqrt(X^2 + Z^2), 1)`: K holds pixels per radian, upright lines stay straight. The domain is
    every direction but straight up and down.
    """

    def __new__(cls, *, max_angle: float | None = None) -> Cylindrical:
        """The lens.

        Args:
            max_angle: radians from the axis beyond which nothing is seen, where a lens's calibration or image circle ends
                before its own limit; None for that limit.

        Raises:
            CalibrationError: a limit that cannot be right.
            ArgumentTypeError: no number.
        """
    @property
    def max_angle(self) -> float:
        """The validity limit, radians from the axis: directions beyond it have no image."""
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]: ...

@final
class Equirectangular:
    """A panorama on a sphere, longitude to the right and latitude downwards. Immutable, comparable, hashable, picklable.

    `pixel = K (atan2(X, Z), atan2(Y, sqrt(X^2 + Z^2)), 1)`: K holds pixels per radian; of a whole sphere that is
    `width / (2 pi)` and `height / pi`, with the axis at `((width - 1) / 2, (height - 1) / 2)`. The domain is every direction.
    """

    def __new__(cls, *, max_angle: float | None = None) -> Equirectangular:
        """The lens.

        Args:
            max_angle: radians from the axis beyond which nothing is seen, where a lens's calibration or image circle ends
                before its own limit; None for that limit.

        Raises:
            CalibrationError: a limit that cannot be right.
            ArgumentTypeError: no number.
        """
    @property
    def max_angle(self) -> float:
        """The validity limit, radians from the axis: directions beyond it have no image."""
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]: ...

@final
class Camera:
    """A calibrated camera: intrinsics, lens, image size and pose. Immutable, comparable, hashable, picklable.

    Frames: vehicle ISO 8855 (x forward, y left, z up), camera optical (x right, y down, z forward), metres; pixel (0, 0)
    is the centre of the top-left pixel.
    """

    def __new__(
        cls,
        K: ArrayLike,
        *,
        image_size: Sequence[int],
        camera_from_vehicle: ArrayLike | None = None,
        vehicle_from_camera: ArrayLike | None = None,
        lens: _Lens | None = None,
        nearest_rotation: bool = False,
    ) -> Camera:
        """A camera from its intrinsic matrix and its pose.

        Args:
            K: (3, 3), `[[fx, skew, cx], [0, fy, cy], [0, 0, 1]]` in pixels. Corner-based principal points (CARLA's
                w / 2) lose 0.5 first.
            image_size: (width, height) in pixels.
            camera_from_vehicle: (4, 4) rigid transform to the optical frame, `p_cam = R p_veh + t`; kept as given.
            vehicle_from_camera: the inverse, for who has that. With neither, the camera stands at the origin and looks
                along +x.
            lens: a lens model, or None for a pinhole.
            nearest_rotation: take the rotation nearest to that of the pose (of its singular value decomposition), where
                |R^T R - I| is up to 3e-2: matrices that were written with two or three digits.

        Raises:
            CalibrationError: K is no pinhole matrix, its focal lengths are those of a placeholder (1.5 pixels or less for
                an image of more than 64), or the pose is not rigid (|R^T R - I| <= 1e-4, det R > 0).
            ArgumentError, ArgumentTypeError: a shape, a size or a type is wrong.

        Warns:
            CalibrationWarning: the focal length is below 5 % of the image's width, fx / fy outside 0.6 to 1.7, or the principal point outside the central 60 % of the image. Cameras derived from this one
                say it no more.
        """
    @classmethod
    def from_euler(
        cls,
        K: ArrayLike,
        *,
        image_size: Sequence[int],
        position: Sequence[float] = (0.0, 0.0, 0.0),
        roll: float = 0.0,
        pitch: float = 0.0,
        yaw: float = 0.0,
        lens: _Lens | None = None,
    ) -> Camera:
        """A camera from where it stands and how it is turned.

        `R = (Rz(yaw) Ry(pitch) Rx(roll))^T`, `t = -R position`, then the optical axes `camX = -Y, camY = -Z, camZ = X`.
        Source: Cityscapes csCalibration.pdf, ISO 8855.

        Args:
            K: (3, 3) intrinsic matrix in pixels.
            image_size: (width, height) in pixels.
            position: (x, y, z) of the optical centre in the vehicle frame, metres.
            roll: radians; positive lifts the left side.
            pitch: radians; positive looks down.
            yaw: radians; positive turns left.
            lens: a lens model, or None for a pinhole.

        Raises:
            CalibrationError: a number is not finite, or K is no pinhole matrix.
            ArgumentError: an angle is beyond a turn (2 pi): degrees; a shape or a size is wrong.

        Warns:
            CalibrationWarning: as `Camera(...)`.
        """
    @classmethod
    def from_vanishing_point(
        cls,
        vanishing_point: Sequence[float],
        *,
        image_size: Sequence[int],
        focal_length: float | Sequence[float],
        height: float,
        principal_point: Sequence[float] | None = None,
        roll: float = 0.0,
        x: float = 0.0,
        y: float = 0.0,
        lens: _Lens | None = None,
    ) -> Camera:
        """A camera without a calibration of its pose: from the pixel where straight lane markings meet, and its height.

        Markings that run along the vehicle's x axis meet where that axis points to; the direction of that pixel is the
        camera's pitch and yaw. `ipm_rs.vanishing_point` finds it from marked lines. With w the direction in axes x
        forward, y left, z up, `Rx(roll) w = (cos pitch cos yaw, -sin yaw, sin pitch cos yaw)`.

        Args:
            vanishing_point: (u, v) in pixels of the raw picture, also outside it.
            image_size: (width, height) in pixels.
            focal_length: pixels, or (fx, fy).
            height: of the optical centre above the vehicle's origin, metres.
            principal_point: (cx, cy) in pixels; the middle of the image, ((w - 1) / 2, (h - 1) / 2), if not given.
            roll: radians; positive lifts the left side. The vanishing point does not tell it.
            x: of the optical centre ahead of the vehicle's origin, metres.
            y: the same to the left.
            lens: the lens model, None for a pinhole.

        Raises:
            CalibrationError: a number is not finite, or a focal length not positive.
            ArgumentError: the lens has no direction for the vanishing point, or roll is beyond a turn (2 pi): degrees.

        Warns:
            CalibrationWarning: as `Camera(...)`.
        """
    @staticmethod
    def from_cityscapes(
        source: str | PathLike[str] | Mapping[str, Any],
        *,
        image_size: Sequence[int] = (2048, 1024),
        nearest_rotation: bool = False,
    ) -> Camera:
        """A camera from a Cityscapes `*_camera.json`, or the same as a dict; see `ipm_rs.calibration.cityscapes.read`.

        Args:
            source: path, or mapping with keys nested in "extrinsic" and "intrinsic" or flat.
            image_size: (width, height); the files do not hold it.
            nearest_rotation: take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

        Raises:
            CalibrationError: a key is missing or its value cannot be right.
            FileError, MissingFileError: the file cannot be read.
        """
    @staticmethod
    def from_kitti(
        source: str | PathLike[str] | Mapping[str, Any],
        *,
        camera: int | str = 2,
        image_size: Sequence[int] | None = None,
        frame: Literal["velodyne", "imu", "camera", "road"] = "velodyne",
        nearest_rotation: bool = False,
    ) -> Camera:
        """A camera of a KITTI calibration file (object, tracking, odometry, road); see `ipm_rs.calibration.kitti.read`.

        Args:
            source: path of the text file, or a mapping of its keys to numbers.
            camera: 0 to 3; 2 is the left colour camera.
            image_size: (width, height); needed, the file does not hold it.
            frame: the vehicle frame. Road: "velodyne" `ground=-1.73`, "imu" -0.93, "camera" -1.65 (all nominal), "road" 0.
            nearest_rotation: take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

        Raises:
            CalibrationError: a key or the image size is missing, or numbers cannot be right.
            ArgumentError, ArgumentTypeError: there is no such camera, or an argument cannot be right.
            FileError, MissingFileError: a file cannot be read.
        """
    @staticmethod
    def from_kitti_raw(
        source: str | PathLike[str] | Mapping[str, Any],
        *,
        camera: int | str = 2,
        rectified: bool = True,
        frame: Literal["velodyne", "imu", "camera"] = "velodyne",
        nearest_rotation: bool = False,
    ) -> Camera:
        """A camera of a KITTI raw calibration; see `ipm_rs.calibration.kitti_raw.read`.

        Args:
            source: the day's directory, its `calib_cam_to_cam.txt`, or a mapping of the files' names to their content.
            camera: 0 to 3; 2 is the left colour camera.
            rectified: the camera of the rectified images; False: of the raw ones, with their lens.
            frame: the vehicle frame; its road as for `from_kitti`.
            nearest_rotation: take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

        Raises:
            CalibrationError: a key is missing or its numbers cannot be right.
            ArgumentError, ArgumentTypeError: there is no such camera, or an argument cannot be right.
            FileError, MissingFileError: a file cannot be read.
        """
    @staticmethod
    def from_kitti_360(
        source: str | PathLike[str] | Mapping[str, Any],
        *,
        camera: int | str | None = None,
        frame: Literal["velodyne", "pose"] = "velodyne",
        nearest_rotation: bool = False,
    ) -> Camera:
        """A camera of a KITTI-360 calibration; see `ipm_rs.calibration.kitti_360.read`.

        Args:
            source: the directory `calibration`, a file of it, or a mapping of the files' names to their content.
            camera: 0, 1 perspective, 2, 3 fisheye; 0 if not given, or that of an `image_0x.yaml`.
            frame: the vehicle frame. Road: "velodyne" `ground=-1.73`, "pose" -0.9, nominal.
            nearest_rotation: take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

        Raises:
            CalibrationError: a key is missing or its numbers cannot be right.
            ArgumentError, ArgumentTypeError: there is no such camera, or an argument cannot be right.
            FileError, MissingFileError: a file cannot be read.
        """
    @staticmethod
    def from_nuscenes(
        source: str | PathLike[str] | Mapping[str, Any] | Sequence[Mapping[str, Any]],
        *,
        camera: str | None = None,
        image_size: Sequence[int] | None = None,
        sensors: str | PathLike[str] | Sequence[Mapping[str, Any]] | None = None,
        nearest_rotation: bool = False,
    ) -> Camera:
        """A camera of nuScenes, Lyft or nuImages, the road at z = 0; see `ipm_rs.calibration.nuscenes.read`.

        Args:
            source: `calibrated_sensor.json`, its directory, the list of records, one record, or a mapping of names to
                records.
            camera: token of the record, or name ("CAM_FRONT") or token of its sensor; not needed for one record.
            image_size: (width, height), 1600 x 900 if not given; needed for Lyft.
            sensors: `sensor.json` or its records; if not given, the file beside `source`.
            nearest_rotation: take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

        Raises:
            CalibrationError: a key is missing or its numbers cannot be right.
            ArgumentError, ArgumentTypeError: there is no such camera, or an argument cannot be right.
            FileError, MissingFileError: a file cannot be read.
        """
    @staticmethod
    def from_argoverse2(
        source: str | PathLike[str] | Mapping[str, Any],
        *,
        camera: str = "ring_front_center",
        nearest_rotation: bool = False,
    ) -> Camera:
        """A camera of an Argoverse 2 log, the road at `ground=-0.33`; see `ipm_rs.calibration.argoverse2.read`.

        Args:
            source: the log's directory, its `calibration`, or mappings of the tables' rows.
            camera: the sensor_name.
            nearest_rotation: take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

        Raises:
            CalibrationError: a key is missing or its numbers cannot be right.
            ArgumentError, ArgumentTypeError: there is no such camera, or an argument cannot be right.
            FileError, MissingFileError: a file cannot be read.
            MissingExtraError: pyarrow, which reads the files, is not installed.
        """
    @staticmethod
    def from_waymo(
        source: Any,
        *,
        camera: str | int | None = None,
        nearest_rotation: bool = False,
    ) -> Camera:
        """A camera from Waymo's CameraCalibration fields; see `ipm_rs.calibration.waymo.read`.

        Args:
            source: one calibration, a list, or a context, as mappings or as a JSON file; or `CameraCalibration` messages.
            camera: its name or number; not needed for one.
            nearest_rotation: take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

        Raises:
            CalibrationError: a key is missing or its numbers cannot be right.
            ArgumentError, ArgumentTypeError: there is no such camera, or an argument cannot be right.
            FileError, MissingFileError: a file cannot be read.
        """
    @staticmethod
    def from_carla(
        source: str | PathLike[str] | Mapping[str, Any] | None = None,
        *,
        camera: str | None = None,
        image_size: Sequence[int] | None = None,
        fov: float | None = None,
        transform: Any = None,
        handedness: Literal["left", "right"] = "left",
        nearest_rotation: bool = False,
    ) -> Camera:
        """A camera of a CARLA sensor, the road at z = 0; see `ipm_rs.calibration.carla.read`.

        Args:
            source: the sensor's attributes, or the ROS bridge's `objects.json`; path or mapping.
            camera: the sensor's id in `objects.json`.
            image_size: (width, height).
            fov: horizontal, degrees.
            transform: `carla.Transform`, 4x4, or mapping of x, y, z (metres) and roll, pitch, yaw (degrees).
            handedness: of the frame of `transform`: CARLA's "left", or "right" (x forward, y left, z up).
            nearest_rotation: take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

        Raises:
            CalibrationError: a number is missing or cannot be right.
            ArgumentError, ArgumentTypeError: there is no such camera, or something was given twice or cannot be right.
            FileError, MissingFileError: a file cannot be read.
        """
    @staticmethod
    def from_json(source: str | PathLike[str] | Mapping[str, Any]) -> Camera:
        """A camera that `save` or `to_json` wrote; see `ipm_rs.calibration.json`.

        Args:
            source: path, the JSON text itself, or what `json.loads` makes of it.

        Raises:
            CalibrationError: another format, a newer version, or numbers that cannot be right.
            ArgumentTypeError: neither text, a path nor a mapping.
            FileError, MissingFileError: a file cannot be read.
        """
    @staticmethod
    def from_colmap(
        source: str | PathLike[str],
        *,
        camera: int | str | None = None,
        images: str | PathLike[str] | None = None,
        image: int | str | None = None,
        image_size: Sequence[int] | None = None,
        vehicle_from_world: ArrayLike | None = None,
        metres_per_unit: float = 1.0,
        nearest_rotation: bool = False,
    ) -> Camera:
        """A camera of a COLMAP text model; see `ipm_rs.calibration.colmap.read`.

        COLMAP counts pixels from the corner; 0.5 is subtracted from its principal point.

        Args:
            source: `cameras.txt`.
            camera: CAMERA_ID, if there are several and no image is chosen.
            images: `images.txt`, for the pose; without it the camera is at the origin and looks along +x.
            image: IMAGE_ID or NAME in `images`.
            image_size: (width, height); must agree with the file.
            vehicle_from_world: (4, 4), where COLMAP's world stands in the vehicle frame, metres.
            metres_per_unit: length of COLMAP's unit.
            nearest_rotation: take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

        Raises:
            CalibrationError: a line cannot be right, or the model has no lens here.
            ArgumentError: there is no such camera or image.
            FileError, MissingFileError: a file cannot be read.
        """
    @staticmethod
    def from_kalibr(
        source: str | PathLike[str] | Mapping[str, Any],
        *,
        camera: str | int | None = None,
        image_size: Sequence[int] | None = None,
        vehicle_from_cam0: ArrayLike | None = None,
        vehicle_from_imu: ArrayLike | None = None,
        nearest_rotation: bool = False,
    ) -> Camera:
        """A camera of a Kalibr camchain (or OpenVINS's); see `ipm_rs.calibration.kalibr.read`.

        Args:
            source: YAML file, or its content.
            camera: "cam1" or 1, if there are several.
            image_size: (width, height); must agree with the file.
            vehicle_from_cam0: (4, 4) pose of the first camera's optical frame; by default it looks along +x.
            vehicle_from_imu: (4, 4) pose of the IMU, in its place.
            nearest_rotation: take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

        Raises:
            CalibrationError: a value cannot be right, or the lens has no model here (`fov`).
            ArgumentError: there is no such camera, or both poses are given.
            FileError, MissingFileError: the file cannot be read.
            MissingExtraError: PyYAML is not installed.
        """
    @staticmethod
    def from_matlab(
        source: str | PathLike[str] | Mapping[str, Any], *, image_size: Sequence[int] | None = None
    ) -> Camera:
        """A camera from the numbers of a MATLAB `monoCamera`; see `ipm_rs.calibration.matlab.read`.

        Pixels become 0-based: one less than MATLAB's.

        Args:
            source: JSON file, or a mapping, with FocalLength, PrincipalPoint, ImageSize [rows columns], Height in
                metres, Pitch, Yaw, Roll in degrees, ...
            image_size: (width, height), if the file lacks ImageSize.

        Raises:
            CalibrationError: a key is missing or its value cannot be right.
            FileError, MissingFileError: the file cannot be read.
        """
    @staticmethod
    def from_opencv(
        source: str | PathLike[str] | Mapping[str, Any],
        *,
        camera: str | int | None = None,
        image_size: Sequence[int] | None = None,
        lens: Literal["brown_conrady", "fisheye", "omnidir", "pinhole"] | None = None,
        extrinsics: str | PathLike[str] | Mapping[str, Any] | None = None,
        rectified: bool = False,
        camera_from_vehicle: ArrayLike | None = None,
        vehicle_from_camera: ArrayLike | None = None,
        vehicle_from_world: ArrayLike | None = None,
        metres_per_unit: float | None = None,
        nearest_rotation: bool = False,
    ) -> Camera:
        """A camera from a file of OpenCV's `FileStorage` or `numpy.savez`; see `ipm_rs.calibration.opencv.read`.

        Args:
            source: YAML, JSON, XML or .npz file, or a mapping of its matrices, under any of the usual names. Nothing is
                unpickled.
            camera: 1 or "left", 2 or "right" of a stereo pair; or the name of a section.
            image_size: (width, height), if the file lacks it.
            lens: which module of OpenCV made the file; needed for four coefficients, which may be either. "pinhole" for a
                file without coefficients, or images that `cv2.undistort` made.
            extrinsics: second file of a stereo calibration (R, T, R1, P1, ...).
            rectified: whether the images of the pair are rectified (R1, P1; R2, P2).
            camera_from_vehicle: (4, 4) pose of the first camera, in place of the file's rvec and tvec.
            vehicle_from_camera: the inverse, for who has that.
            vehicle_from_world: (4, 4), where the world of rvec and tvec stands in the vehicle frame, metres.
            metres_per_unit: length of the unit of tvec and T, 0.001 for millimetres; without it they are metres, and more
                than 20 are refused.
            nearest_rotation: take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

        Raises:
            CalibrationError: a matrix is missing, ambiguous or cannot be right, or there are no coefficients.
            ArgumentError: `lens` or `camera` is needed or wrong; poses are given twice.
            FileError, MissingFileError: a file cannot be read.
            MissingExtraError: PyYAML is not installed.
        """
    @staticmethod
    def from_ros(
        source: Any,
        *,
        image: Literal["raw", "rectified"] = "raw",
        camera: str | None = None,
        image_size: Sequence[int] | None = None,
        camera_from_vehicle: ArrayLike | None = None,
        vehicle_from_camera: ArrayLike | None = None,
        ros_binning: bool = False,
        metres_per_unit: float | None = None,
        nearest_rotation: bool = False,
    ) -> Camera:
        """A camera from a ROS CameraInfo; see `ipm_rs.calibration.ros.read`.

        Args:
            source: YAML or INI file, its content as a mapping, or a `sensor_msgs/CameraInfo` message.
            image: "raw" takes K and D, "rectified" takes P and R.
            camera: section of an INI file of several cameras.
            image_size: (width, height); must agree with the file.
            camera_from_vehicle: (4, 4) pose of the raw optical frame; by default it looks along +x.
            vehicle_from_camera: the inverse, for who has that.
            ros_binning: move the principal point under binning as ROS does, without the half pixel.
            metres_per_unit: length of the unit of P's fourth column; without it metres, at most 20.
            nearest_rotation: take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

        Raises:
            CalibrationError: the camera is uncalibrated, a value cannot be right, or the model is not known.
            ArgumentError, ArgumentTypeError: an argument is wrong.
            FileError, MissingFileError: the file cannot be read.
            MissingExtraError: PyYAML is not installed.
        """
    @staticmethod
    def from_woodscape(
        source: str | PathLike[str] | Mapping[str, Any],
        *,
        image_size: Sequence[int] | None = None,
        nearest_rotation: bool = False,
    ) -> Camera:
        """A camera from a WoodScape fisheye calibration; see `ipm_rs.calibration.woodscape.read`.

        Args:
            source: JSON file, or its content. The road is at z = 0.
            image_size: (width, height); must agree with the file.
            nearest_rotation: take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

        Raises:
            CalibrationError: a key is missing or its value cannot be right.
            FileError, MissingFileError: the file cannot be read.
        """
    @staticmethod
    def from_camodocal(
        source: str | PathLike[str] | Mapping[str, Any],
        *,
        camera: str | int | None = None,
        image_size: Sequence[int] | None = None,
        vehicle_from_imu: ArrayLike | None = None,
        nearest_rotation: bool = False,
    ) -> Camera:
        """A camera of camodocal, or of the settings of VINS that name it; see `ipm_rs.calibration.camodocal.read`.

        Args:
            source: a camera's file, or VINS settings; needs the extra `yaml`.
            camera: which of the settings': 0, 1, "cam0", "cam1".
            image_size: (width, height); must agree with the file.
            vehicle_from_imu: (4, 4) pose of the IMU in the vehicle frame; without it the first camera looks along +x.
            nearest_rotation: take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

        Raises:
            CalibrationError: a key is missing, a value cannot be right, or the model is none of the four.
            ArgumentError, ArgumentTypeError: an argument is wrong.
            FileError, MissingFileError: the file cannot be read.
        """
    @staticmethod
    def from_euroc(
        source: str | PathLike[str] | Mapping[str, Any],
        *,
        image_size: Sequence[int] | None = None,
        vehicle_from_body: ArrayLike | None = None,
        nearest_rotation: bool = False,
    ) -> Camera:
        """A camera of EuRoC's `sensor.yaml`; see `ipm_rs.calibration.euroc.read`.

        Args:
            source: the file, or its content; needs the extra `yaml`.
            image_size: (width, height); must agree with the file.
            vehicle_from_body: (4, 4) pose of the body (the IMU) in the vehicle frame; without it the first camera looks along +x.
            nearest_rotation: take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

        Raises:
            CalibrationError: a key is missing, a value cannot be right, or the lens has no model here.
            ArgumentError, ArgumentTypeError: an argument is wrong.
            FileError, MissingFileError: the file cannot be read.
        """
    @staticmethod
    def from_ncamera(
        source: str | PathLike[str] | Mapping[str, Any],
        *,
        camera: str | int | None = None,
        image_size: Sequence[int] | None = None,
        vehicle_from_body: ArrayLike | None = None,
        nearest_rotation: bool = False,
    ) -> Camera:
        """One camera of an aslam `ncamera.yaml` (maplab, SVO Pro); see `ipm_rs.calibration.ncamera.read`.

        Args:
            source: the file, or its content; needs the extra `yaml`.
            camera: its label, or its number from 0; needed if there is more than one.
            image_size: (width, height); must agree with the file.
            vehicle_from_body: (4, 4) pose of the body (the IMU) in the vehicle frame; without it the first camera looks along +x.
            nearest_rotation: take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

        Raises:
            CalibrationError: a key is missing, a value cannot be right, or the lens has no model here.
            ArgumentError, ArgumentTypeError: an argument is wrong.
            FileError, MissingFileError: the file cannot be read.
        """
    @staticmethod
    def from_okvis(
        source: str | PathLike[str] | Mapping[str, Any],
        *,
        camera: str | int | None = None,
        image_size: Sequence[int] | None = None,
        vehicle_from_imu: ArrayLike | None = None,
        nearest_rotation: bool = False,
    ) -> Camera:
        """One camera of okvis's configuration; see `ipm_rs.calibration.okvis.read`.

        Args:
            source: the file, or its content; needs the extra `yaml`.
            camera: its number from 0; needed if there is more than one.
            image_size: (width, height); must agree with the file.
            vehicle_from_imu: (4, 4) pose of the IMU in the vehicle frame; without it the first camera looks along +x.
            nearest_rotation: take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

        Raises:
            CalibrationError: a key is missing, a value cannot be right, or the lens has no model here.
            ArgumentError, ArgumentTypeError: an argument is wrong.
            FileError, MissingFileError: the file cannot be read.
        """
    @staticmethod
    def from_basalt(
        source: str | PathLike[str] | Mapping[str, Any],
        *,
        camera: str | int | None = None,
        image_size: Sequence[int] | None = None,
        vehicle_from_imu: ArrayLike | None = None,
        nearest_rotation: bool = False,
    ) -> Camera:
        """One camera of basalt's `calibration.json`; see `ipm_rs.calibration.basalt.read`.

        Args:
            source: the file, or its content.
            camera: its number from 0; needed if there is more than one.
            image_size: (width, height); must agree with the file.
            vehicle_from_imu: (4, 4) pose of the IMU in the vehicle frame; without it the first camera looks along +x.
            nearest_rotation: take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

        Raises:
            CalibrationError: a key is missing, a value cannot be right, or the lens has no model here.
            ArgumentError, ArgumentTypeError: an argument is wrong.
            FileError, MissingFileError: the file cannot be read.
        """
    @staticmethod
    def from_orbslam(
        source: str | PathLike[str] | Mapping[str, Any],
        *,
        camera: str | int | None = None,
        image_size: Sequence[int] | None = None,
        vehicle_from_imu: ArrayLike | None = None,
        nearest_rotation: bool = False,
    ) -> Camera:
        """A camera of the settings of ORB-SLAM2 or ORB-SLAM3; see `ipm_rs.calibration.orbslam.read`.

        Args:
            source: the settings, or their content; need the extra `yaml`.
            camera: 1 or 2; needed if both are there.
            image_size: (width, height); needed if the file lacks it, and must agree if it has it.
            vehicle_from_imu: (4, 4) pose of the IMU in the vehicle frame; without it the first camera looks along +x.
            nearest_rotation: take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

        Raises:
            CalibrationError: a key is missing, a value cannot be right, or the lens has no model here.
            ArgumentError, ArgumentTypeError: an argument is wrong.
            FileError, MissingFileError: the file cannot be read.
        """
    @staticmethod
    def from_nerfstudio(
        source: str | PathLike[str] | Mapping[str, Any],
        *,
        camera: str | int | None = None,
        image_size: Sequence[int] | None = None,
        vehicle_from_world: ArrayLike | None = None,
        metres_per_unit: float = 1.0,
        nearest_rotation: bool = False,
    ) -> Camera:
        """The camera of one frame of a `transforms.json` (nerfstudio, instant-ngp, NeRF synthetic); see `ipm_rs.calibration.nerfstudio.read`.

        Args:
            source: the file, or its content.
            camera: the frame's `file_path` or its number from 0; needed if there is more than one.
            image_size: (width, height); needed if the file lacks `w` and `h`, and must agree if it has them.
            vehicle_from_world: (4, 4) pose of the file's world, in metres, in the vehicle frame.
            metres_per_unit: length of the world's unit.
            nearest_rotation: take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

        Raises:
            CalibrationError: a key is missing, a value cannot be right, or the lens has no model here.
            ArgumentError, ArgumentTypeError: an argument is wrong.
            FileError, MissingFileError: the file cannot be read.
        """
    @staticmethod
    def from_open3d(
        source: str | PathLike[str] | Mapping[str, Any],
        *,
        camera: str | int | None = None,
        image_size: Sequence[int] | None = None,
        vehicle_from_world: ArrayLike | None = None,
        nearest_rotation: bool = False,
    ) -> Camera:
        """A camera of Open3D's JSON files; see `ipm_rs.calibration.open3d.read`.

        Args:
            source: the file, or its content.
            camera: number from 0 in a trajectory.
            image_size: (width, height); must agree with the file.
            vehicle_from_world: (4, 4) pose of the world of `extrinsic` in the vehicle frame.
            nearest_rotation: take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

        Raises:
            CalibrationError: a key is missing or its value cannot be right.
            ArgumentError, ArgumentTypeError: an argument is wrong.
            FileError, MissingFileError: the file cannot be read.
        """
    @staticmethod
    def from_depthai(
        source: str | PathLike[str] | Mapping[str, Any],
        *,
        camera: str | int | None = None,
        image_size: Sequence[int] | None = None,
        vehicle_from_base: ArrayLike | None = None,
        nearest_rotation: bool = False,
    ) -> Camera:
        """One camera of DepthAI's calibration of an OAK device; see `ipm_rs.calibration.depthai.read`.

        Args:
            source: the file, or its content.
            camera: its socket, 0, 1, 2 or "CAM_A", "CAM_B", "CAM_C"; needed if more than one is calibrated.
            image_size: (width, height); must agree with the file.
            vehicle_from_base: (4, 4) pose in the vehicle frame of the camera at the end of the chain; without it that one
                looks along +x.
            nearest_rotation: take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

        Raises:
            CalibrationError: a key is missing, a value cannot be right, or the lens has no model here.
            ArgumentError, ArgumentTypeError: an argument is wrong.
            FileError, MissingFileError: the file cannot be read.
        """
    @staticmethod
    def from_ocamcalib(
        source: str | PathLike[str],
        *,
        image_size: Sequence[int] | None = None,
        camera_from_vehicle: ArrayLike | None = None,
        vehicle_from_camera: ArrayLike | None = None,
    ) -> Camera:
        """A camera of OCamCalib's `calib_results.txt`; see `ipm_rs.calibration.ocamcalib.read`.

        Args:
            source: the file.
            image_size: (width, height); must agree with the file.
            camera_from_vehicle: (4, 4) pose in either direction; without it the camera looks along +x.
            vehicle_from_camera: the same the other way round; give one of them.

        Raises:
            CalibrationError: a row is missing or cannot be right.
            ArgumentError, ArgumentTypeError: an argument is wrong.
            FileError, MissingFileError: the file cannot be read.
        """
    @staticmethod
    def from_dgp(
        source: str | PathLike[str] | Mapping[str, Any],
        *,
        camera: str | None = None,
        image_size: Sequence[int] | None = None,
        nearest_rotation: bool = False,
    ) -> Camera:
        """One camera of DGP's `calibration/<sha>.json` (DDAD, Parallel Domain); see `ipm_rs.calibration.dgp.read`.

        Args:
            source: the file, or its content.
            camera: its name, "CAMERA_01"; needed if there is more than one.
            image_size: (width, height), which the format does not state; DDAD's are (1936, 1216).
            nearest_rotation: take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

        Raises:
            CalibrationError: a key is missing, a value cannot be right, or `image_size` was not given.
            ArgumentError, ArgumentTypeError: an argument is wrong.
            FileError, MissingFileError: the file cannot be read.
        """
    @staticmethod
    def from_argoverse1(
        source: str | PathLike[str] | Mapping[str, Any],
        *,
        camera: str | None = None,
        image_size: Sequence[int] | None = None,
        nearest_rotation: bool = False,
    ) -> Camera:
        """One camera of Argoverse 1's `vehicle_calibration_info.json`; see `ipm_rs.calibration.argoverse1.read`.

        Args:
            source: the file, or its content.
            camera: its name, "ring_front_center"; needed if there is more than one.
            image_size: (width, height), which the file does not state: (1920, 1200), or (2464, 2056) for stereo.
            nearest_rotation: take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

        Raises:
            CalibrationError: a key is missing, a value cannot be right, or `image_size` was not given.
            ArgumentError, ArgumentTypeError: an argument is wrong.
            FileError, MissingFileError: the file cannot be read.
        """
    @staticmethod
    def from_mmdet3d(
        source: str | PathLike[str] | Mapping[str, Any],
        *,
        camera: str | None = None,
        image_size: Sequence[int] | None = None,
        frame: Literal["ego", "lidar"] | None = None,
        nearest_rotation: bool = False,
    ) -> Camera:
        """A camera entry of mmdetection3d's info files; see `ipm_rs.calibration.mmdet3d.read`.

        Args:
            source: one camera's entry, or a frame's with `images`: a JSON file or a mapping.
            camera: its key in `images`, "CAM_FRONT"; needed if there is more than one.
            image_size: (width, height); needed if the entry lacks them, and must agree if it has them.
            frame: which is the vehicle's, through `cam2ego` or `lidar2cam`; without it the ego vehicle's where it is there.
            nearest_rotation: take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

        Raises:
            CalibrationError: a key is missing or its value cannot be right.
            ArgumentError, ArgumentTypeError: an argument is wrong.
            FileError, MissingFileError: the file cannot be read.
        """
    @staticmethod
    def from_once(
        source: str | PathLike[str] | Mapping[str, Any],
        *,
        camera: str | None = None,
        image_size: Sequence[int] | None = None,
        image: Literal["raw", "undistorted"] = "raw",
        nearest_rotation: bool = False,
    ) -> Camera:
        """One camera of a sequence of ONCE; see `ipm_rs.calibration.once.read`.

        Args:
            source: the file, or its content.
            camera: its name, "cam01"; needed if there is more than one.
            image_size: (width, height), which the file does not state: (1920, 1020).
            image: whether the images are as the camera gave them, or went through the kit's `undistort_image`.
            nearest_rotation: take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave
                it.

        Raises:
            CalibrationError: a key is missing or its value cannot be right.
            ArgumentError, ArgumentTypeError: an argument is wrong.
            FileError, MissingFileError: the file cannot be read.
        """
    @staticmethod
    def from_zod(
        source: str | PathLike[str] | Mapping[str, Any],
        *,
        image_size: Sequence[int] | None = None,
        nearest_rotation: bool = False,
    ) -> Camera:
        """The front camera of the Zenseact Open Dataset; see `ipm_rs.calibration.zod.read`.

        Args:
            source: `calibration.json`, or its content.
            image_size: (width, height); must agree with the file.
            nearest_rotation: take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave
                it.

        Raises:
            CalibrationError: a key is missing or its value cannot be right.
            ArgumentError, ArgumentTypeError: an argument is wrong.
            FileError, MissingFileError: the file cannot be read.
        """
    @staticmethod
    def from_openlane(
        source: str | PathLike[str] | Mapping[str, Any],
        *,
        camera: str | None = None,
        image_size: Sequence[int] | None = None,
        nearest_rotation: bool = False,
    ) -> Camera:
        """The camera of a frame of OpenLane, or one of OpenLane-V2; see `ipm_rs.calibration.openlane.read`.

        Args:
            source: the frame's JSON, or its content.
            camera: its name in V2, "ring_front_center"; needed if there is more than one.
            image_size: (width, height), which the file does not state: (1920, 1280) in V1.
            nearest_rotation: take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave
                it.

        Raises:
            CalibrationError: a key is missing or its value cannot be right.
            ArgumentError, ArgumentTypeError: an argument is wrong.
            FileError, MissingFileError: the file cannot be read.
        """
    @staticmethod
    def from_pandaset(
        source: str | PathLike[str] | Mapping[str, Any],
        *,
        camera: str | None = None,
        image_size: Sequence[int] | None = None,
        nearest_rotation: bool = False,
    ) -> Camera:
        """One camera of PandaSet; see `ipm_rs.calibration.pandaset.read`.

        Args:
            source: `static_extrinsic_calibration.yaml`, or its content.
            camera: its name, "front_camera"; needed if there is more than one.
            image_size: (width, height), which the file does not state: (1920, 1080).
            nearest_rotation: take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave
                it.

        Raises:
            CalibrationError: a key is missing or its value cannot be right.
            ArgumentError, ArgumentTypeError: an argument is wrong.
            FileError, MissingFileError: the file cannot be read.
        """
    @staticmethod
    def from_a2d2(
        source: str | PathLike[str] | Mapping[str, Any],
        *,
        camera: str | None = None,
        image_size: Sequence[int] | None = None,
        image: Literal["original", "undistorted"] = "original",
    ) -> Camera:
        """One camera of Audi's A2D2; see `ipm_rs.calibration.a2d2.read`.

        Args:
            source: `cams_lidars.json`, or its content.
            camera: its name, "front_center"; needed if there is more than one.
            image_size: (width, height); must agree with the file.
            image: whether the images are as published, or went through the tutorial's `undistort_image`.

        Raises:
            CalibrationError: a key is missing or its value cannot be right.
            ArgumentError, ArgumentTypeError: an argument is wrong.
            FileError, MissingFileError: the file cannot be read.
        """
    @staticmethod
    def from_cam2bev(
        source: str | PathLike[str] | Mapping[str, Any],
        *,
        image_size: Sequence[int] | None = None,
    ) -> Camera:
        """A camera of Cam2BEV; see `ipm_rs.calibration.cam2bev.read`.

        Args:
            source: the YAML file, or its content.
            image_size: (width, height), which the file does not state: (964, 604).

        Raises:
            CalibrationError: a key is missing or its value cannot be right.
            ArgumentError, ArgumentTypeError: an argument is wrong.
            FileError, MissingFileError: the file cannot be read.
        """
    @staticmethod
    def from_autoware(
        source: str | PathLike[str] | Mapping[str, Any],
        *,
        image_size: Sequence[int] | None = None,
        vehicle_from_lidar: ArrayLike | None = None,
        nearest_rotation: bool = False,
    ) -> Camera:
        """A camera of Autoware.AI's camera-lidar calibration; see `ipm_rs.calibration.autoware.read`.

        Args:
            source: the file, or its content.
            image_size: (width, height); must agree with the file.
            vehicle_from_lidar: (4, 4) pose of the lidar in the vehicle frame; without it the lidar's frame is that.
            nearest_rotation: take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave
                it.

        Raises:
            CalibrationError: a key is missing or its value cannot be right.
            ArgumentError, ArgumentTypeError: an argument is wrong.
            FileError, MissingFileError: the file cannot be read.
        """
    @staticmethod
    def from_pjlab(
        source: str | PathLike[str] | Mapping[str, Any],
        *,
        extrinsic: str | PathLike[str] | Mapping[str, Any] | None = None,
        image_size: Sequence[int] | None = None,
        nearest_rotation: bool = False,
    ) -> Camera:
        """A camera of SensorsCalibration (PJLab-ADG); see `ipm_rs.calibration.pjlab.read`.

        Args:
            source: the intrinsic file, or its content.
            extrinsic: the extrinsic file from or to this camera; without it the camera is at the origin and looks along
                +x.
            image_size: (width, height); must agree with the file.
            nearest_rotation: take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave
                it.

        Raises:
            CalibrationError: a key is missing or its value cannot be right.
            ArgumentError, ArgumentTypeError: an argument is wrong.
            FileError, MissingFileError: the file cannot be read.
        """
    @staticmethod
    def from_realsense(
        source: str | PathLike[str] | Mapping[str, Any],
        *,
        camera: str | None = None,
        image_size: Sequence[int] | None = None,
        camera_from_vehicle: ArrayLike | None = None,
        vehicle_from_camera: ArrayLike | None = None,
        inverse_means: Literal["undistorts", "distorts"] | None = None,
    ) -> Camera:
        """Intrinsics of one stream of an Intel RealSense; see `ipm_rs.calibration.realsense.read`.

        Args:
            source: JSON, YAML or what `rs-enumerate-devices -c` prints, or the content as a mapping.
            camera: the stream, "color", or "Color 1280x720" in text; needed if there is more than one.
            image_size: (width, height); must agree with the file.
            camera_from_vehicle: (4, 4) pose in either direction; without it the camera looks along +x.
            vehicle_from_camera: the same the other way round; give one of them.
            inverse_means: what coefficients of "Inverse Brown Conrady" that are not all 0 do: "undistorts", from the image
                to the ray, or "distorts"; librealsense takes them either way.

        Raises:
            CalibrationError: a key is missing or its value cannot be right.
            ArgumentError, ArgumentTypeError: an argument is wrong.
            FileError, MissingFileError: the file cannot be read.
        """
    @staticmethod
    def from_opensfm(
        source: str | PathLike[str] | Mapping[str, Any] | Sequence[Any],
        *,
        camera: str | None = None,
        image_size: Sequence[int] | None = None,
        vehicle_from_world: ArrayLike | None = None,
        metres_per_unit: float = 1.0,
    ) -> Camera:
        """The camera of one shot of OpenSfM; see `ipm_rs.calibration.opensfm.read`.

        Args:
            source: `reconstruction.json` or `camera_models.json`, or its content.
            camera: the shot, or the camera; needed if there is more than one.
            image_size: (width, height); needed if the file lacks it, and must agree if it has it.
            vehicle_from_world: (4, 4) pose of the file's world, in metres, in the vehicle frame; without it the world
                is that.
            metres_per_unit: length of the world's unit in metres.

        Raises:
            CalibrationError: a key is missing or its value cannot be right.
            ArgumentError, ArgumentTypeError: an argument is wrong.
            FileError, MissingFileError: the file cannot be read.
        """
    @staticmethod
    def from_metashape(
        source: str | PathLike[str],
        *,
        camera: str | int | None = None,
        image_size: Sequence[int] | None = None,
        vehicle_from_world: ArrayLike | None = None,
        metres_per_unit: float | None = None,
        nearest_rotation: bool = False,
    ) -> Camera:
        """One camera of Agisoft Metashape's `cameras.xml`; see `ipm_rs.calibration.metashape.read`.

        Args:
            source: the XML file.
            camera: label of an aligned camera, or its number from 0; needed if there is more than one.
            image_size: (width, height); must agree with the file.
            vehicle_from_world: (4, 4) pose of the file's world, in metres, in the vehicle frame; without it the world
                is that.
            metres_per_unit: length of the chunk's unit in metres; without it the file's `scale`.
            nearest_rotation: take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave
                it.

        Raises:
            CalibrationError: a key is missing or its value cannot be right.
            ArgumentError, ArgumentTypeError: an argument is wrong.
            FileError, MissingFileError: the file cannot be read.
        """
    @staticmethod
    def load(
        path: str | PathLike[str],
        image_size: Sequence[int] | None = None,
        camera: str | int | None = None,
        *,
        lens: Literal["brown_conrady", "fisheye", "omnidir", "pinhole"] | None = None,
        frame: str | None = None,
        metres_per_unit: float | None = None,
        nearest_rotation: bool = False,
    ) -> Camera:
        """A camera from a calibration file (or a dataset's directory) whose format is recognised.

        Which format was taken is logged at level INFO by the logger "ipm_rs.calibration", and returned by
        `ipm_rs.calibration.recognise`. A format without a pose gives a camera at the origin that looks along +x.

        Args:
            path: the file or directory.
            image_size: (width, height) in pixels, for formats that do not hold it; where the file does, the two must
                agree.
            camera: which one, where the file holds several: a name or a number, as the format has it.
            lens: which, where an OpenCV file does not say it; see `from_opencv`.
            frame: which of the dataset's frames the vehicle frame is, for the KITTI formats; "camera" for files that hold
                projection matrices only.
            metres_per_unit: length of the file's unit, for OpenCV, ROS and COLMAP: 0.001 for millimetres.
            nearest_rotation: take the nearest rotation for one that is off by up to 3e-2, as three printed digits leave it.

        Raises:
            CalibrationError: no format fits (the message lists what was tried and what each lacked), the content cannot
                be right, or something that the file lacks was not given.
            ArgumentError: an option was given that the format leaves no choice of, or one is needed: the message says
                which.
            FileError, MissingFileError: the file cannot be read.
            MissingExtraError: the format needs PyYAML or pyarrow, which are not installed.
        """
    @staticmethod
    def load_all(
        path: str | PathLike[str],
        image_size: Sequence[int] | None = None,
        *,
        lens: Literal["brown_conrady", "fisheye", "omnidir", "pinhole"] | None = None,
        frame: str | None = None,
        metres_per_unit: float | None = None,
        nearest_rotation: bool = False,
    ) -> dict[str, Camera]:
        """Every camera of a calibration file or directory, by its name: what `Rig` is made of.

        nuScenes, Argoverse 2, Waymo, KITTI, KITTI-360, CARLA, a Kalibr chain, an OpenCV stereo pair or a section for
        each camera, COLMAP, what `Rig.save` wrote; or a directory with a calibration file for each camera, whose names
        are then the cameras'. A file of one camera gives one, by the file's name.

        Args:
            path: the file or directory.
            image_size: as for `load`; it and the options go for every camera.
            lens: as for `load`.
            frame: as for `load`.
            metres_per_unit: as for `load`.
            nearest_rotation: as for `load`.

        Raises:
            CalibrationError: as `load`, and for a directory in which no file is a calibration.
            ArgumentError: an option was given that the format does not have.
            FileError, MissingFileError: a file cannot be read.
            MissingExtraError: the format needs PyYAML or pyarrow, which are not installed.
        """
    @staticmethod
    def from_ground_points(
        pixels: ArrayLike,
        ground_points: ArrayLike,
        *,
        image_size: Sequence[int],
        K: ArrayLike | None = None,
        lens: _Lens | None = None,
        ground: float | Plane | HeightMap = 0.0,
        principal_point: Sequence[float] | None = None,
        tolerance: float = 4.0,
    ) -> Camera:
        """A camera from points of the road that were surveyed and found in its raw image, through any lens.

        Four points are enough; with more, wrong ones are left out. `ipm_rs.refine.from_ground_points` takes the same and
        says how far the pose can be trusted.

        Args:
            pixels: (N, 2), where the image shows the points.
            ground_points: (N, 2), (x, y) of the points in the vehicle frame, metres.
            image_size: (width, height), pixels.
            K: (3, 3) intrinsic matrix, pixels; without it the focal length is found too, of square pixels.
            lens: the lens; a pinhole if not given.
            ground: the road that the points are on: its height, or a surface.
            principal_point: where K is not known, (cx, cy); the middle of the image if not given.
            tolerance: points that are farther off than this, pixels, are taken for mistakes.

        Raises:
            ArgumentError, ArgumentTypeError: fewer than 4 points, all on a line, their mirror image, no four that agree, or
                points that do not tell the focal length.
            CalibrationError: K, the size or the lens cannot be right.
        """
    @staticmethod
    def from_points(
        pixels: ArrayLike,
        points: ArrayLike,
        *,
        image_size: Sequence[int],
        K: ArrayLike | None = None,
        lens: _Lens | None = None,
        principal_point: Sequence[float] | None = None,
        tolerance: float = 4.0,
    ) -> Camera:
        """A camera from points of any height that were surveyed and found in its raw image, through any lens.

        Of three points up to four poses are right: the most upright one is taken. `ipm_rs.refine.from_points` gives the
        others too, and says how far the pose can be trusted.

        Args:
            pixels: (N, 2), where the image shows the points, at least 3; at least 4 without K.
            points: (N, 3), the points in the vehicle frame, metres.
            image_size: (width, height), pixels.
            K: (3, 3) intrinsic matrix, pixels; without it the focal length is found too, of square pixels.
            lens: the lens; a pinhole if not given.
            principal_point: where K is not known, (cx, cy); the middle of the image if not given.
            tolerance: points that are farther off than this, pixels, are taken for mistakes.

        Raises:
            ArgumentError, ArgumentTypeError: too few points, all on a line, too few that agree, or points that do not tell
                the focal length.
            CalibrationError: K, the size or the lens cannot be right.
        """
    @staticmethod
    def from_projection(P: ArrayLike, *, image_size: Sequence[int]) -> Camera:
        """A pinhole camera from its projection matrix, K [R | t] times any number.

        Args:
            P: (3, 4), vehicle frame (x, y, z, 1), metres, to homogeneous pixels.
            image_size: (width, height), pixels.

        Raises:
            CalibrationError: no camera has such a matrix.
            ArgumentError, ArgumentTypeError: it is no (3, 4) array of numbers.
        """
    @staticmethod
    def from_fov(
        fov: float,
        *,
        image_size: Sequence[int],
        vertical: bool = False,
        position: Sequence[float] = (0.0, 0.0, 0.0),
        roll: float = 0.0,
        pitch: float = 0.0,
        yaw: float = 0.0,
        lens: _Lens | None = None,
    ) -> Camera:
        """A camera from its angle of view, with square pixels and the axis through the image's middle.

        Args:
            fov: from the left edge of the image to the right, radians.
            image_size: (width, height), pixels.
            vertical: the angle is from the top edge to the bottom instead.
            position: x, y, z in the vehicle frame, metres.
            roll: left side up, radians.
            pitch: down, radians.
            yaw: to the left, radians.
            lens: a lens; the angle is then that of its pinhole.

        Raises:
            CalibrationError: the angle cannot be right.
            ArgumentError, ArgumentTypeError: another argument is wrong.
        """
    def undistorted(
        self,
        *,
        size: Sequence[int] | None = None,
        focal: float | Sequence[float] | None = None,
        alpha: float | None = None,
        level: bool = False,
        lens: _Lens | None = None,
    ) -> Camera:
        """The camera of this one's picture without its lens, at the same place, for `Lut.between`.

        `Lut.between(camera, camera.undistorted())` is `cv2.undistort`: the same K and size, straight lines straight.

        Args:
            size: (width, height) of the new picture; the old ones if not given.
            focal: focal length in pixels, or (fx, fy), with the axis in the picture's middle. Without it and `alpha` the
                scale on the axis and the principal point stay, scaled with the size as `resized` does.
            alpha: from 0, the largest upright rectangle that is all of the old picture, to 1, the smallest that holds all
                of it, as `cv2.getOptimalNewCameraMatrix` has it.
            level: turn the view level, roll and pitch 0, where this camera looks.
            lens: of the new camera: `Cylindrical()`, `Equirectangular()`, or any other. None is a pinhole, which shows less
                than 180 degrees.

        Raises:
            CalibrationError: with `alpha` a flat picture would have to show more than 85 degrees from its axis.
            ArgumentError, ArgumentTypeError: both `focal` and `alpha`, or numbers that cannot be right.
        """
    def project_polygon(
        self, points: ArrayLike, *, ground: float | Plane | None = None, margin: float = 0.0
    ) -> NDArray[np.float64]:
        """The image of a polygon, clipped to the picture and closed, for `cv2.fillPoly` and its like.

        What lies behind the camera or outside the lens's domain is cut off; edges are bent as the lens bends them.

        Args:
            points: (N, 3) vertices in the vehicle frame, metres, in order; or (N, 2) on the ground.
            ground: height or plane of (N, 2) points; None is 0.
            margin: pixels around the rectangle of pixel centres that are kept.

        Returns:
            (M, 2) float64, pixels of the part that is seen; (0, 2) where nothing is. Parts that a concave polygon falls into
            are joined along the picture's edge by lines that take no area.

        Raises:
            ArgumentError, ArgumentTypeError: fewer than three vertices, another shape, or numbers that are not finite.
        """
    def ground_polygon(
        self, pixels: ArrayLike, *, ground: float | Plane | None = None, max_distance: float = 200.0
    ) -> NDArray[np.float64]:
        """The ground that a polygon of the picture shows, closed: what lies above the horizon is cut off.

        Args:
            pixels: (N, 2) vertices (u, v), in order.
            ground: the road; None is height 0.
            max_distance: metres from below the camera, level, at which it is cut: towards the horizon there is no end of it.

        Returns:
            (M, 3) float64, vertices in the vehicle frame, metres; (0, 3) where no ground is seen.

        Raises:
            ArgumentError, ArgumentTypeError: fewer than three vertices, another shape, numbers that are not finite, or a
                vertex that the lens has no ray for.
        """
    def to_json(self) -> str:
        """The camera as JSON text, each float to the last bit; `from_json` gives an equal camera."""
    def save(self, path: str | PathLike[str]) -> None:
        """Writes the camera as a JSON file, whole or not at all; `load` and `from_json` give an equal camera.

        Args:
            path: the file; an existing one is replaced.

        Raises:
            FileError: the file cannot be written.
            ArgumentTypeError: no path.
        """
    @property
    def intrinsics(self) -> NDArray[np.float64]:
        """K, (3, 3) float64, pixels."""
    @property
    def lens(self) -> _Lens | None:
        """The lens model beyond the pinhole; None for a pinhole."""
    @property
    def image_size(self) -> tuple[int, int]:
        """(width, height) in pixels."""
    @property
    def is_panorama(self) -> bool:
        """Whether its image is a panorama of 360 degrees, whose last column is followed by its first: `Cylindrical` or
        `Equirectangular`, with a focal length of the width by 2 pi. Tables of it have no seam."""
    @property
    def camera_from_vehicle(self) -> NDArray[np.float64]:
        """(4, 4) float64, `p_cam = R p_veh + t`, as given."""
    @property
    def vehicle_from_camera(self) -> NDArray[np.float64]:
        """(4, 4) float64, the inverse of `camera_from_vehicle`."""
    @property
    def position(self) -> NDArray[np.float64]:
        """The optical centre in the vehicle frame, (3,) float64, metres."""
    def project(
        self,
        points: ArrayLike,
        *,
        ground: float | Plane | HeightMap | None = None,
        out: tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]] | None = None,
        threads: int | None = None,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
        """Points of the vehicle frame to pixels.

        Args:
            points: (N, 3) in metres, or (N, 2) on the road. Float32 and float64 with any row stride are not copied, so
                `sweep[:, :3]` of an (N, 4) array costs nothing.
            ground: the road under (N, 2) points: its height, a `Plane` or a `HeightMap`, 0 if not given; refused with
                (N, 3).
            out: where to write, (uv, depth, valid): C-contiguous arrays of the shapes and dtypes below that share no
                memory with each other or with `points`.
            threads: at most how many threads; the result does not depend on it.

        Returns:
            uv: (N, 2) float64 pixels; NaN only where a point has no image (behind the camera, outside the lens's domain,
                not finite).
            depth: (N,) float64, z in the camera frame, metres; negative behind, where a lens of more than 180 degrees
                still sees.
            valid: (N,) bool, has an image, inside the rectangle of pixel centres; of (N, 2) points on a `HeightMap` also
                not hidden by a crest.

        Raises:
            ArgumentError, ArgumentTypeError, DtypeError: a shape or a type is wrong, or `out` cannot take the result.
        """
    def unproject(
        self, uv: ArrayLike, *, out: NDArray[np.float64] | None = None, threads: int | None = None
    ) -> NDArray[np.float64]:
        """Pixels to the directions that they look along.

        Args:
            uv: (N, 2) pixels, also outside the image.
            out: where to write, (N, 3) float64, C-contiguous; it shares no memory with `uv`.
            threads: at most how many threads; the result does not depend on it.

        Returns:
            (N, 3) float64 unit vectors in the vehicle frame; NaN outside the lens's domain.

        Raises:
            ArgumentError, ArgumentTypeError, DtypeError: a shape or a type is wrong, or `out` cannot take the result.
        """
    def ground_from_pixels(
        self,
        uv: ArrayLike,
        *,
        ground: float | Plane | HeightMap = 0.0,
        out: NDArray[np.float64] | None = None,
        threads: int | None = None,
    ) -> NDArray[np.float64]:
        """Pixels to the road points that they see.

        Args:
            uv: (N, 2) pixels, also outside the image.
            ground: the road: its height in metres, a `Plane` or a `HeightMap`.
            out: where to write, (N, 3) float64, C-contiguous; it shares no memory with `uv`.
            threads: at most how many threads; the result does not depend on it.

        Returns:
            (N, 3) float64 in the vehicle frame, metres; NaN where the ray misses the road.

        Raises:
            ArgumentError, ArgumentTypeError, DtypeError: a shape or a type is wrong, or `out` cannot take the result.
        """
    def resized(self, width: int, height: int) -> Camera:
        """The camera of the image resampled to width x height: `c' = (c + 0.5) s - 0.5`, `f' = s f`, per axis.

        Raises:
            ArgumentError, ArgumentTypeError: not two whole numbers of at least 1.
        """
    def cropped(self, x: int, y: int, width: int, height: int) -> Camera:
        """The camera of `image[y:y + height, x:x + width]`: only the principal point moves.

        Raises:
            ArgumentError, ArgumentTypeError: the rectangle is empty or leaves the image.
        """
    def binned(
        self, x: int, y: int | None = None, *, rule: Literal["area", "first_pixel"] = "area"
    ) -> Camera:
        """The camera of the image of which each x x y block of pixels became one; `f' = f / b`.

        A last block that is not whole is left out: 641 columns binned by 2 are 320.

        Args:
            x: columns of a block.
            y: rows of a block, as many as columns if not given.
            rule: where the block's centre lies. "area": in its middle, `c' = (c + 0.5) / b - 0.5`, where averaging or
                summing pixels puts it. "first_pixel": at its first pixel, `c' = c / b`, where `image[::b, ::b]` puts it
                and what ROS's CameraInfo prescribes for its binning.

        Raises:
            ArgumentError, ArgumentTypeError: a block without pixels, or larger than the image.
        """
    def rotated180(self) -> Camera:
        """The camera of `image[::-1, ::-1]`: turned half a turn about its axis, as one that hangs upside down.

        `c' = (w - 1 - cx, h - 1 - cy)`, `R' = diag(-1, -1, 1) R`; a lens that is not round turns with it.
        """
    def mirrored(self) -> Camera:
        """The camera of `image[:, ::-1]` in the mirrored world: it sees at (x, -y, z) what this one sees at (x, y, z).

        No camera takes a mirror image of the world as it is: its frame would be left-handed. So points, labels and the
        bird's-eye view that go with a mirrored image are mirrored too, y to -y (`flip_handedness`). `image[::-1]` is
        that of `camera.mirrored().rotated180()`.
        """
    def masked(self, mask: ArrayLike | None = None, *, hide: ArrayLike | Sequence[ArrayLike] | None = None) -> Camera:
        """The same camera, some of whose pixels do not show the road: the own bonnet, mirrors, what lies outside a
        fisheye's circle.

        Cells of a `Lut` or `RigLut` whose footprint touches a hidden pixel are not in its mask and get the border value.
        The mask goes where the camera goes: into pickles and JSON, and through `resized`, `cropped`, `binned`,
        `rotated180`, `mirrored` and `with_pose`. Masks of several calls add up. `project` and its kin are geometry and
        do not look at it.

        Args:
            mask: (H, W), of the shape of the images; True, or not 0, where they show the road.
            hide: (M, 2) polygon of pixels (u, v), or several, which do not show the road: the pixels whose centres are
                inside (even-odd rule).

        Raises:
            ImageError: the mask has another shape.
            ArgumentError, ArgumentTypeError: neither was given; a polygon is none.
        """
    @property
    def mask(self) -> NDArray[np.bool_] | None:
        """(H, W) bool, True where the images show the road, as a new array; None where all of them do."""
    def pixels_from_cells(
        self, rc: ArrayLike, grid: BevGrid, *, ground: float | Plane | HeightMap = 0.0
    ) -> tuple[NDArray[np.float64], NDArray[np.float64], NDArray[np.bool_]]:
        """Cells of a grid to the pixels that `Lut(camera, grid, ground=ground)` samples for them.

        Args:
            rc: (N, 2) (row, column), whole at the samples, also between cells and outside the grid.
            grid: the grid.
            ground: the road, as for the table.

        Returns:
            (uv, depth, valid) as `project`; valid is the table's mask.

        Raises:
            ArgumentError, ArgumentTypeError: the shape or a type is wrong.
        """
    def cells_from_pixels(
        self, uv: ArrayLike, grid: BevGrid, *, ground: float | Plane | HeightMap = 0.0
    ) -> NDArray[np.float64]:
        """Pixels to the cells that show what they see: the inverse of `pixels_from_cells`.

        Args:
            uv: (N, 2) pixels, also outside the image.
            grid: the grid.
            ground: the road, as for the table.

        Returns:
            (N, 2) float64 (row, column), whole at the samples, also outside the grid; NaN where a pixel sees no road.

        Raises:
            ArgumentError, ArgumentTypeError: the shape or a type is wrong.
        """
    def project_polyline(
        self,
        points: ArrayLike,
        *,
        ground: float | Plane | HeightMap | None = None,
        closed: bool = False,
        margin: float = 0.0,
        tolerance: float = 0.25,
    ) -> list[NDArray[np.float64]]:
        """A polyline of the vehicle frame as it appears in the image: a lane, a box edge, a path.

        It is cut where the camera's image ends, in front of it or at the limit of its lens, and clipped to the image, so
        that nothing wraps; between its vertices it is bent as the lens bends it. On a `HeightMap` it follows the road and
        is cut where that is not known or hidden by a crest.

        Args:
            points: (N, 3) in metres, or (N, 2) on the road. A vertex that is not finite is a gap.
            ground: the road under (N, 2) points, 0 if not given; refused with (N, 3).
            closed: whether the last vertex is joined to the first.
            margin: pixels around the rectangle of pixel centres up to which it is kept; 0 to 1e9.
            tolerance: how far, in pixels, the polyline may be from the true curve; 0.001 to 1e9.

        Returns:
            The pieces, each (M, 2) float64 pixels with M of 2 or more, in the order of the points; none where it is not
            seen. `cv2.polylines(image, [np.round(p).astype(np.int32) for p in pieces], False, colour)` draws them.

        Raises:
            ArgumentError, ArgumentTypeError: the shape or another argument is wrong, or the image of the line winds on
                and on, so that no reasonable number of points follows it.
        """
    def horizon(
        self, *, ground: float | Plane = 0.0, tolerance: float = 0.25
    ) -> list[NDArray[np.float64]]:
        """The horizon in the image: pixels whose rays run along the road and never meet it.

        Args:
            ground: the road; of a height all that counts is that it is level.
            tolerance: how far, in pixels, the polyline may be from a curve that a lens bends; 0.001 to 1e9.

        Returns:
            Pieces inside the rectangle of pixel centres, each (M, 2) float64: for a pinhole at most one, of two points;
            none where the camera does not see it.

        Raises:
            ArgumentError, ArgumentTypeError: the road has no one horizon, or another argument is wrong.
        """
    def horizon_line(self, *, ground: float | Plane = 0.0) -> tuple[float, float, float] | None:
        """The horizon of a pinhole as (a, b, c): `a u + b v + c = 0`, `a^2 + b^2 = 1`.

        `a u + b v + c` is the distance of a pixel from it, positive below. It is `K^-T R n`, n the road's normal.

        Args:
            ground: the road; of a height all that counts is that it is level.

        Returns:
            (a, b, c), or None where the image is parallel to the road and the horizon lies at infinity.

        Raises:
            ArgumentError: the camera has a lens, which bends the horizon; see `horizon`.
        """
    def ground_range(
        self, uv: ArrayLike, *, ground: float | Plane | HeightMap = 0.0
    ) -> NDArray[np.float64]:
        """Metres from the camera to the road points that pixels see, measured level (in x and y).

        Args:
            uv: (N, 2) pixels, also outside the image.
            ground: the road.

        Returns:
            (N,) float64; NaN where a pixel sees no road.

        Raises:
            ArgumentError, ArgumentTypeError: the shape or the type is wrong.
        """
    def row_ranges(
        self, *, column: float | None = None, ground: float | Plane | HeightMap = 0.0
    ) -> NDArray[np.float64]:
        """`ground_range` for each row of the image.

        Args:
            column: where in the row, in pixels; the middle of the image if not given.
            ground: the road.

        Returns:
            (height,) float64 metres; NaN above the horizon.

        Raises:
            ArgumentError, ArgumentTypeError: an argument is no number or no road.
        """
    def range_error(
        self,
        uv: ArrayLike,
        *,
        ground: float | Plane | HeightMap = 0.0,
        pixel: float = 1.0,
        pitch_deg: float = 0.1,
    ) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
        """By how many metres `ground_range` is off where the pixel, or the camera's pitch, is a little off.

        Found by looking there and not by a derivative: near the horizon ranges grow without bound within a pixel.

        Args:
            uv: (N, 2) pixels.
            ground: the road.
            pixel: by how many pixels a pixel is off, in the direction in which its range changes fastest.
            pitch_deg: by how many degrees the camera's pitch, that of `from_euler`, is off.

        Returns:
            (by_pixel, by_pitch), each (N,) float64 metres: the larger error of both directions, infinite where one of
            them sees no road, NaN where the pixel itself sees none.

        Raises:
            ArgumentError, ArgumentTypeError: the shape or the type is wrong, or an error is negative or not finite.
        """
    def with_pose(self, camera_from_vehicle: ArrayLike, *, nearest_rotation: bool = False) -> Camera:
        """The same camera elsewhere.

        Args:
            camera_from_vehicle: (4, 4) rigid transform to the optical frame.
            nearest_rotation: as for `Camera(...)`.

        Raises:
            CalibrationError: it is not rigid.
        """
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]: ...

@final
class BevGrid:
    """A rectangle of equal cells on the road. Immutable, comparable, hashable, picklable.

    Row 0 is the farthest (x max), column 0 the leftmost (y max). Cell (i, j) samples
    `X = x_max - (i + s) dx`, `Y = y_max - (j + s) dy` with s = 0.5 for "center" and 0 for "corner".
    """

    def __new__(
        cls,
        *,
        x: Sequence[float],
        y: Sequence[float],
        resolution: float | Sequence[float],
        sample_at: Literal["center", "corner"] = "center",
    ) -> BevGrid:
        """A grid from its ranges and its cell size.

        Args:
            x: (min, max) along x, metres, forward.
            y: (min, max) along y, metres, left.
            resolution: cell size in metres, or (along x, along y).
            sample_at: which point of a cell is looked up; "corner" (far left) is the sampling of the widely copied
                tutorials.

        Raises:
            GridError: a range is reversed, empty, not finite or no whole number of cells (to 1e-6; the message names
                the nearest that is), a cell size is not positive, or there are more than 2^28 cells.
        """
    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns)."""
    @property
    def x(self) -> tuple[float, float]:
        """(min, max) along x, metres."""
    @property
    def y(self) -> tuple[float, float]:
        """(min, max) along y, metres."""
    @property
    def resolution(self) -> tuple[float, float]:
        """Cell size (along x, along y), metres."""
    @property
    def sample_at(self) -> Literal["center", "corner"]:
        """Which point of a cell is looked up."""
    def xy(self) -> NDArray[np.float64]:
        """The road points of all samples: (rows, columns, 2) float64, (x, y) in metres."""
    def cell_from_ground(self, xy: ArrayLike) -> NDArray[np.float64]:
        """Road points to cells.

        Args:
            xy: (N, 2) in metres.

        Returns:
            (N, 2) float64 (row, column), whole at the samples, also outside the grid.

        Raises:
            ArgumentError, ArgumentTypeError: the shape or the type is wrong.
        """
    def ground_from_cell(self, rc: ArrayLike) -> NDArray[np.float64]:
        """Cells to road points: the inverse of `cell_from_ground`.

        Args:
            rc: (N, 2) (row, column), also fractional.

        Returns:
            (N, 2) float64 (x, y) in metres.

        Raises:
            ArgumentError, ArgumentTypeError: the shape or the type is wrong.
        """
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]: ...

@final
class Plane:
    """A plane road: any but an upright one. Immutable, comparable, hashable, picklable; goes wherever `ground=` does.

    A plane above the camera is seen from below, as a ceiling is.
    """

    def __new__(cls, *, normal: Sequence[float], point: Sequence[float] = (0.0, 0.0, 0.0)) -> Plane:
        """The plane through a point at right angles to a normal, in the vehicle frame.

        `n . p + d = 0`, as fitted planes are often given, goes through `point = -d n / (n . n)`.

        Args:
            normal: (x, y, z), of any length and either sign.
            point: (x, y, z) in metres, any point of the plane.

        Raises:
            ArgumentError: the normal is zero, or horizontal: an upright plane has no height at (x, y); or the plane is more
                than 100 km above or below the vehicle.
            CalibrationError: a number is not finite.
        """
    @classmethod
    def from_coefficients(cls, a: float, b: float, c: float) -> Plane:
        """The plane `z = a + b x + c y`.

        Args:
            a: height at the vehicle's origin, metres.
            b: metres up for each metre ahead.
            c: metres up for each metre to the left.

        Raises:
            ArgumentError: `a` is beyond 100 km, or a slope beyond 2e9.
            CalibrationError: a number is not finite.
        """
    @classmethod
    def from_angles(cls, *, slope: float = 0.0, bank: float = 0.0, height: float = 0.0) -> Plane:
        """The plane `z = height + tan(slope) x + tan(bank) y`.

        Args:
            slope: radians; positive climbs ahead. A grade of 6 % is `atan(0.06)`.
            bank: radians; positive lifts the left side, as positive roll does.
            height: height at the vehicle's origin, metres.

        Raises:
            ArgumentError: an angle is a quarter turn or more, or the height beyond 100 km.
            CalibrationError: a number is not finite.
        """
    @property
    def coefficients(self) -> tuple[float, float, float]:
        """(a, b, c) of `z = a + b x + c y`."""
    @property
    def normal(self) -> NDArray[np.float64]:
        """The unit normal that points up, (3,) float64."""
    def transformed(self, T: ArrayLike) -> Plane:
        """The same plane in another frame.

        Args:
            T: (4, 4), takes points of the plane's frame to the other: a rotation and a translation in metres.

        Raises:
            ArgumentError: the plane stands upright there.
            CalibrationError: T is no rigid motion.
            ArgumentTypeError: T is no array of numbers.
        """
    @staticmethod
    def from_camera(camera: Camera, *, normal: Sequence[float], point: Sequence[float]) -> Plane:
        """The plane that was measured in a camera's own frame, as from a board or a depth image.

        Args:
            camera: in whose optical frame (x right, y down, z forward) it is given; its pose takes it to the vehicle.
            normal: of any length and either sign. A level road's is about (0, -1, 0).
            point: any point of the plane, metres. Of `n . p + d = 0` it is `-d n / (n . n)`.

        Raises:
            ArgumentError: the normal is zero, or the plane upright in the vehicle frame.
            ArgumentTypeError, CalibrationError: no camera; numbers that are none or not finite.
        """
    def height_at(self, xy: ArrayLike) -> NDArray[np.float64]:
        """z of the road.

        Args:
            xy: (N, 2) in metres.

        Returns:
            (N,) float64, metres.

        Raises:
            ArgumentError, ArgumentTypeError: the shape or the type is wrong.
        """
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    def __reduce__(self) -> tuple[Any, tuple[float, float, float]]: ...

@final
class HeightMap:
    """A road of heights at the nodes of a grid. Immutable, comparable, hashable, picklable; goes wherever `ground=` does.

    Between the nodes it is bilinear. Outside the map, and beside a node whose height is NaN, the road is not known:
    points there have no pixel, cells are invalid. A ray ends where it first meets the road, so pixels of a crest are
    points of the crest, and what a crest hides is not valid, in `Camera.project` of (N, 2) points and in a `Lut`.
    """

    def __new__(cls, heights: ArrayLike, *, origin: Sequence[float], spacing: float | Sequence[float]) -> HeightMap:
        """A map from its heights, its origin and its spacing.

        `heights[i, j]` is z at `(origin[0] + i spacing[0], origin[1] + j spacing[1])` in the vehicle frame.

        Args:
            heights: (rows, columns), at least 2 x 2, metres; NaN where the road is not known. Rows go along x, columns
                along y.
            origin: (x, y) of `heights[0, 0]`, metres.
            spacing: metres from one node to the next, one number or (along x, along y); negative where they count down.

        Raises:
            ArgumentError: fewer nodes than 2 x 2, no height that is known, or a spacing of zero; or a height that stands for
                "no data" in elevation files: beyond 100 km, or -32768, -9999 and the like, far from all others. Replace
                it by NaN: `np.where(heights > -1e4, heights, np.nan)`.
            CalibrationError: the origin or the spacing is not finite.
            ArgumentTypeError: the heights are not real numbers.
        """
    @classmethod
    def on_grid(cls, heights: ArrayLike, grid: BevGrid) -> HeightMap:
        """A map of heights at the samples of a grid, in its order: row 0 farthest, column 0 leftmost.

        It ends at the outermost samples, so with cell centres half a cell inside the grid's edge.

        Args:
            heights: of the grid's shape, metres; NaN where the road is not known.
            grid: the grid.

        Raises:
            ArgumentError: another shape than the grid's, or as for `HeightMap`.
        """
    @property
    def heights(self) -> NDArray[np.float64]:
        """The heights, (rows, columns) float64, metres; a copy."""
    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns): nodes along x, nodes along y."""
    @property
    def origin(self) -> tuple[float, float]:
        """(x, y) of `heights[0, 0]`, metres."""
    @property
    def spacing(self) -> tuple[float, float]:
        """Metres from one node to the next (along x, along y)."""
    def height_at(self, xy: ArrayLike) -> NDArray[np.float64]:
        """z of the road.

        Args:
            xy: (N, 2) in metres.

        Returns:
            (N,) float64, metres; NaN where the road is not known.

        Raises:
            ArgumentError, ArgumentTypeError: the shape or the type is wrong.
        """
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __hash__(self) -> int: ...
    def __reduce__(self) -> tuple[Any, tuple[Any, ...]]: ...

@final
class _RigTable:
    def __new__(
        cls,
        names: list[str],
        cameras: list[Camera],
        grid: BevGrid,
        *,
        ground: float | Plane | HeightMap,
        masks: list[NDArray[Any] | None],
        exclude: list[NDArray[Any]],
        blend: str,
        feather: float,
    ) -> _RigTable: ...
    def without(self, missing: list[int]) -> _RigTable: ...
    @property
    def nbytes(self) -> int: ...
    def mask(self) -> NDArray[np.bool_]: ...
    def seen(self, camera: int) -> NDArray[np.bool_]: ...
    def source(self) -> NDArray[np.int16]: ...
    def weights(self, camera: int) -> NDArray[np.float32]: ...
    def warp(
        self,
        images: list[Any],
        *,
        interpolation: str,
        gains: NDArray[np.float64] | None,
        border_value: float | Sequence[float],
        out: Any,
        threads: int | None,
        layout: str,
    ) -> NDArray[Any]: ...
    def warp_adjoint(
        self, grad: Any, *, interpolation: str, threads: int | None, layout: str
    ) -> list[NDArray[Any]]: ...
    def gains(self, images: list[Any], previous: NDArray[np.float64] | None) -> NDArray[np.float32]: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...

@final
class Lut:
    """Where every cell of a bird's-eye view samples the image: built once, used for every frame.

    Immutable, comparable, picklable; one table serves images of every dtype, channel count and row stride, from several
    threads at once.
    """

    def __new__(
        cls,
        camera: Camera,
        grid: BevGrid,
        *,
        ground: float | Plane | HeightMap = 0.0,
        border_mode: _BorderMode = "constant",
    ) -> Lut:
        """The table of a camera and a grid.

        Cells behind the camera or outside its image are invalid; nothing wraps, but for a panorama of 360 degrees
        (`Cylindrical` or `Equirectangular`), whose last column is followed by its first. On a `HeightMap` so are cells where the
        road is not known, and those that a crest hides. Of a road that passes through the camera, which sees it edge-on, all
        are.

        Args:
            camera: the camera.
            grid: the grid on the road.
            ground: the road in the vehicle frame: its height in metres (not 0 in every dataset), a `Plane` or a
                `HeightMap`.
            border_mode: what cells take whose road point is outside the image: "constant" is the warp's border value;
                "replicate" (aaa|abcd|ddd), "reflect" (cba|abcd|dcb), "reflect_101" (dcb|abcd|cba) and "wrap"
                (bcd|abcd|abc) go on with the image's own pixels. Such cells are not valid in any mode, and those behind
                the camera or outside its lens's domain have no pixel in any.

        Raises:
            ArgumentError, ArgumentTypeError: an argument is of another kind, or `ground` is not finite.
            OutOfMemoryError: there is not enough memory for the table.

        Warns:
            CalibrationWarning: the camera is not above its road, or no cell sees the image; the text says why.
        """
    @classmethod
    def from_maps(
        cls,
        map_x: NDArray[np.floating[Any]] | NDArray[np.int16],
        map_y: NDArray[np.floating[Any]] | NDArray[np.uint16] | None,
        *,
        source_size: Sequence[int],
        border_mode: _BorderMode = "constant",
        source_wraps: bool = False,
    ) -> Lut:
        """A table from maps as `cv2.remap` takes them: cell (i, j) samples (map_x[i, j], map_y[i, j]).

        Args:
            map_x: (rows, columns) float32 or float64, source columns in pixels; NaN and infinity are no image. Or (rows,
                columns, 2) int16, whole columns and rows: the first that `cv2.convertMaps` gives for CV_16SC2.
            map_y: the same for source rows. Or (rows, columns) uint16 beside int16 pairs: the second that `cv2.convertMaps`
                gives, in 32nds of a pixel; None for whole pixels.
            source_size: (width, height) of the images that it is for.
            border_mode: what lies beyond the image, as for `Lut`; NaN and infinity give the border value in every mode.
            source_wraps: whether the image's last column is followed by its first, as in a panorama of 360 degrees: what
                lies between the two is inside the image, and columns beyond either side are those of the other.

        Raises:
            LutError, DtypeError: shapes or dtypes are wrong or differ.
            ArgumentError, ArgumentTypeError: another argument is wrong.
        """
    @classmethod
    def from_homography(
        cls,
        M: ArrayLike,
        *,
        size: Sequence[int] | None = None,
        source_size: Sequence[int],
        grid: BevGrid | None = None,
        border_mode: _BorderMode = "constant",
    ) -> Lut:
        """A table from a homography, of pixels or of metres.

        Args:
            M: (3, 3). With `size=` it maps output pixel (column, row, 1) to source pixel, `cv2.WARP_INVERSE_MAP`'s direction,
                and both signs of the third component sample the image: a homography's sign is arbitrary. With `grid=` it maps
                (x, y, 1) on the ground in metres, x ahead and y to the left, to source pixel, and what lies beyond its horizon
                is invalid. `numpy.linalg.inv` turns one that goes the other way.
            size: (width, height) of the output.
            source_size: (width, height) of the images that it is for.
            grid: the cells of a bird's-eye view, instead of `size`.
            border_mode: what lies beyond the image, as for `Lut`.

        Raises:
            LutError: M is singular or not finite.
            ArgumentError, ArgumentTypeError: both or neither of `size` and `grid`; with `grid=` an M that has y to the right,
                or goes the other way: the middle of the picture's last row would see no ground.
        """
    @staticmethod
    def between(source: Camera, target: Camera, *, border_mode: _BorderMode = "constant") -> Lut:
        """A table from the pictures of a camera to those that another takes from the same place.

        Each pixel of the target looks along a ray, and samples the source where that ray is seen: undistorted, rectified,
        turned, cropped, on a cylinder, or any lens from any other. What the source does not see, or masks, is invalid.
        Coordinates are those of `cv2.initUndistortRectifyMap` and `cv2.fisheye.initUndistortRectifyMap`, to 1/65536 pixel.

        Args:
            source: whose pictures are warped.
            target: whose pictures are made, such as `source.undistorted()`.
            border_mode: what lies beyond the source's picture, as for `Lut`.

        Raises:
            ArgumentError: the cameras stand at different places.
            ArgumentTypeError: no cameras.
            OutOfMemoryError: there is no memory for the table.
        """
    @classmethod
    def from_ground_points(
        cls, image_points: ArrayLike, ground_points: ArrayLike, grid: BevGrid, *, source_size: Sequence[int]
    ) -> Lut:
        """A table without a calibration: from four or more points of the road and the pixels that see them.

        The road is the plane of the points. What lies beyond their horizon is invalid, which a `from_homography` cannot
        know; `homography_from_points` gives the homography itself, and by how many pixels each point is off.

        Args:
            image_points: (N, 2) pixels (u, v), of an image without distortion.
            ground_points: (N, 2) the same points in metres, x ahead, y to the left.
            grid: the grid on the road.
            source_size: (width, height) of the images that it is for.

        Raises:
            ArgumentError: fewer than four points, points that coincide or lie on a line, pairs that are mixed up, or that
                make a mirror image of the road.
            CalibrationError: a coordinate is not finite.
        """
    def warp(
        self,
        image: NDArray[Any] | _DLPack | memoryview,
        *,
        interpolation: Literal["nearest", "bilinear", "cubic", "lanczos4", "area", "mode"] = "bilinear",
        border_mode: _BorderMode | Literal["transparent"] | None = None,
        border_value: float | Sequence[float] = 0,
        out: _Out | None = None,
        threads: int | None = None,
        layout: Literal["HWC", "CHW", "NHWC", "NCHW"] = "HWC",
    ) -> NDArray[Any] | _Out:
        """Warps an image to the grid: a bird's-eye view. Or several: a batch, planes, a batch of planes.

        Args:
            image: (H, W) or (H, W, C) of the table's source size, or what `layout` says, with any stride between rows,
                planes and images; read without a copy. A NumPy array, or what shares its memory as one: a CPU tensor
                (DLPack, `__array__`), a memoryview. "bilinear", "cubic", "lanczos4" and "area" take uint8, int8, uint16, int16,
                float16, float32 and float64, "nearest" any bool, integer or float dtype of 1, 2, 4 or 8 bytes, "mode"
                the same without floats. The result has the image's dtype.
            interpolation: "bilinear" blends the four pixels around the coordinate. "nearest" copies one (halves to
                even), so label images keep their ids. "cubic" (4 x 4 pixels, a = -0.75) and "lanczos4" (8 x 8) are OpenCV's:
                sharper where a picture is magnified, in views of about its own scale; on a road, whose cells are larger than
                pixels, they alias as bilinear does, and more. "area" is the mean of all that the cell covers of the image, so
                that nothing flickers or makes patterns of its own where a cell is larger than a pixel; where it is not,
                it is bilinear. "mode" is the id that most of what the cell covers has, the smallest of equally frequent
                ones, for label images of up to 256 ids. Both leave out what lies outside the image.
            border_mode: "transparent": cells that are not in `mask` keep what `out` holds, which must be given. None is
                what the table was built for, and no other can be had of it: a table holds where its cells sample.
            border_value: what cells without an image get: a number that the dtype can hold, or one for each channel.
                Less than one pixel outside the image, bilinear and area blend with it; cubic and lanczos4 wherever they reach
                beyond it.
            out: where to write, of the image's dtype and the result's shape, not overlapping the image; an array or a
                tensor.
            threads: at most how many threads, the caller's among them; None is `get_num_threads()`. The result does not
                depend on it.
            layout: the order of the axes of `image` and of the result. "HWC": (H, W) or (H, W, C). "CHW": (C, H, W).
                "NHWC": (N, H, W, C). "NCHW": (N, C, H, W). Threads share out all images and planes together.

        Returns:
            The array in the same layout, rows for H and columns for W, of the image's dtype; `out` itself, array or
            tensor, if that was given.

        Raises:
            ImageError: a shape, the memory layout or the image's size is wrong; out is read-only or overlaps the image.
            DtypeError: the dtype is not taken by this interpolation, or out's differs.
            ArgumentError, ArgumentTypeError: more than 256 ids for "mode"; another argument is wrong, or the image's memory cannot be had without a
                copy or is not the CPU's. In every case nothing has been written.
        """
    def warp_adjoint(
        self,
        grad: NDArray[Any] | _DLPack | memoryview,
        *,
        interpolation: Literal["bilinear", "nearest", "area"] = "bilinear",
        out: _Out | None = None,
        threads: int | None = None,
        layout: Literal["HWC", "CHW", "NHWC", "NCHW"] = "HWC",
    ) -> NDArray[Any] | _Out:
        """The transpose of `warp`: from a value for each cell to one for each pixel.

        Each pixel gets the sum over the cells that look at it of the cell's value times the pixel's part in the cell. That is
        what the gradient of a loss goes back through, and what splats a bird's-eye view into the image: with a border of 0,
        `(lut.warp(x) * y).sum()` and `(x * lut.warp_adjoint(y)).sum()` are the same but for rounding. Pixels that no cell
        looks at are 0; what cells outside the image hold goes nowhere. Sums are in float64, always in the same order.

        The first call turns the table round, in the time of a dozen warps, and keeps that in memory: about 35 bytes a cell
        ("bilinear"), 12 ("nearest") or more than 50 ("area", the more the more pixels cells cover).

        Args:
            grad: (rows, columns) or (rows, columns, C) of `shape`, or what `layout` says; float32 or float64.
            interpolation: of the warp whose transpose it is.
            out: where to write, of the grad's dtype and the result's shape, not overlapping the grad.
            threads: at most how many threads; None is `get_num_threads()`. The result does not depend on it.
            layout: the order of the axes of `grad` and of the result, as in `warp`.

        Returns:
            The array of the table's source size in the same layout and dtype; `out` itself if that was given.

        Raises:
            ImageError: a shape or the memory layout is wrong; out is read-only or overlaps the grad.
            DtypeError: grad is neither float32 nor float64, or out's dtype differs.
            ArgumentError, ArgumentTypeError: interpolation is "mode"; another argument is wrong.
            LutError: interpolation is "area" and a side of the images is 2^20 pixels or longer.
            OutOfMemoryError: there is not enough memory for the table turned round.
        """
    @property
    def shape(self) -> tuple[int, int]:
        """(rows, columns) of the output."""
    @property
    def source_size(self) -> tuple[int, int]:
        """(width, height) of the images that it is for."""
    @property
    def camera(self) -> Camera | None:
        """The camera that the table is of; None where it was made of maps, a homography or pairs of points."""
    @property
    def grid(self) -> BevGrid | None:
        """The grid of its cells; None where it was made of maps or a homography."""
    @property
    def ground(self) -> float | Plane | HeightMap | None:
        """The road that its camera looks at, as `ground=` takes it: a height in metres where it is level. None where there
        is no camera."""
    @property
    def border_mode(self) -> str:
        """What its cells take that are outside the image: "constant" is the warp's border value."""
    @property
    def source_wraps(self) -> bool:
        """Whether the source's last column is followed by its first, as in a panorama of 360 degrees."""
    @property
    def nbytes(self) -> int:
        """Bytes that the table holds, at most 12 a cell, and what warps have added to them.

        The first `warp` with "area" adds how its cells are averaged, the first with "nearest" on a CPU whose best
        instruction set is AVX2 the nearest pixel of each cell (4 bytes).
        """
    @property
    def mask(self) -> NDArray[np.bool_]:
        """Which cells are valid: in front of the camera and inside the image's pixel centres. (rows, columns) bool."""
    def sampling_density(self) -> NDArray[np.float32]:
        """How many source pixels a cell sees along each of its axes.

        They are the sides of the parallelogram that the cell covers on the image: central differences of the table's
        coordinates, one-sided beside cells without an image. Above 1 a cell sees more than bilinear looks at
        (`interpolation="area"` takes all of it); below 1 one pixel is stretched over several cells.

        Returns:
            (rows, columns, 2) float32, pixels a cell: [..., 0] down the rows (along x of a `BevGrid`), [..., 1] along
            the columns (y). NaN where `mask` is False.
        """
    def resolved_mask(self, minimum: float = 0.5) -> NDArray[np.bool_]:
        """Which cells' content is really seen, not made up between pixels: (rows, columns) bool.

        Args:
            minimum: source pixels a cell that there must be in every direction on the grid; 0.5 is one pixel for every
                two cells. Both numbers of `sampling_density` may be larger where the mask is False: far to the side a
                step ahead and a step aside lead the same way on the image, and what lies across it is not told apart.

        Raises:
            ArgumentTypeError: no number.
        """
    def maps(self, outside: float | None = None) -> tuple[NDArray[np.float32], NDArray[np.float32]]:
        """The table as maps for `cv2.remap` and its like.

        Args:
            outside: what cells without an image get; None is NaN.

        Returns:
            (map_x, map_y), each (rows, columns) float32: source pixels of valid cells and of those less than one pixel
            outside the image. `cv2.remap(image, *lut.maps(outside=-9))` gives `lut.warp(image)` to one grey level. Of a
            table with another `border_mode` than "constant", cells outside the image have the place where it has the same.

        Raises:
            ArgumentTypeError: no number.
        """
    def save(self, path: str | PathLike[str]) -> None:
        """Writes the table as a file, whole or not at all; `load` gives an equal one.

        The file holds camera, grid and ground too, where the table was built from them, and a checksum of every part.
        Its name usually ends in `.ipmlut`. For files of other programs, see `export`.

        Args:
            path: the file; an existing one is replaced.

        Raises:
            FileError: the file cannot be written.
            ArgumentTypeError: no path.
        """
    @classmethod
    def load(
        cls,
        path: str | PathLike[str],
        *,
        expect: Camera | BevGrid | Sequence[Camera | BevGrid] | None = None,
        source_size: tuple[int, int] | None = None,
    ) -> Lut:
        """A table from a file of `save`, or of `export` as `"opencv"`, `"lanenet"` or `"npz"`; the content decides.

        Every byte of our own files is checked, and every bound that a warp relies on is proved again. The maps of the
        others are float32, so a table that comes back from them is equal to 2^-14 of a pixel or so, and knows no camera.

        Args:
            path: the file.
            expect: the Camera, the BevGrid, or both, that the table must be of: a table of yesterday's calibration is
                refused, and the message says in what it differs.
            source_size: (width, height) of the images, where maps of another program do not say it.

        Raises:
            MissingFileError: there is no such file.
            FileError: it cannot be read.
            LutError: it is no table, cut short, damaged, written by a newer version, or not of what was expected.
            ArgumentError: `source_size` is missing, or another than the file's.
            ArgumentTypeError: `path` is no path, or `expect` something else than cameras and grids.
        """
    def export(
        self,
        path: str | PathLike[str],
        *,
        format: Literal["opencv", "lanenet", "cv16sc2", "npz", "torch_grid", "c_header"] | None = None,
    ) -> None:
        """Writes the table for another program, whole or not at all.

        | format | file | content |
        |---|---|---|
        | `"opencv"` | `.yml` | `map_x`, `map_y` float32 for `cv2.FileStorage` and `cv2.remap` |
        | `"lanenet"` | `.yml` | the same as `remap_ipm_x`, `remap_ipm_y` |
        | `"cv16sc2"` | `.yml` | `map1` int16 with two channels, `map2` uint16: 1/32 of a pixel, faster in `cv2.remap` |
        | `"npz"` | `.npz` | `map_x`, `map_y`, `mask`, `source_size` |
        | `"torch_grid"` | `.npy` | (1, rows, columns, 2) float32 for `grid_sample(..., align_corners=True)` |
        | `"c_header"` | `.h` | `static const float` arrays, and macros with their sizes |

        Maps are source pixels, pixel (0, 0) the centre of the first; cells without an image are -9, which every constant
        border answers with its value.

        Args:
            path: the file; an existing one is replaced.
            format: by default what the file's ending says, `"opencv"` for `.yml`.

        Raises:
            FileError: the file cannot be written.
            ArgumentError: there is no such format, or its files have another ending.
            LutError: the format cannot hold the table.
            ArgumentTypeError: no path.
        """
    @classmethod
    def _from_bytes(
        cls,
        data: bytes,
        camera: Camera | None = None,
        grid: BevGrid | None = None,
        ground: float | Plane | HeightMap | None = None,
    ) -> Lut: ...
    @classmethod
    def _read_from(
        cls,
        file: BinaryIO,
        length: int,
        camera: Camera | None = None,
        grid: BevGrid | None = None,
        ground: float | Plane | HeightMap | None = None,
    ) -> Lut: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __reduce__(self) -> tuple[Any, tuple[bytes]]: ...

def _checksum(data: bytes) -> int: ...
def rotation_from_euler(roll: float, pitch: float, yaw: float) -> NDArray[np.float64]:
    """`Rz(yaw) Ry(pitch) Rx(roll)`: (3, 3) float64, turns vectors of the rotated body into its parent's frame.

    Args:
        roll: radians; positive lifts the left side.
        pitch: radians; positive looks down.
        yaw: radians; positive turns left.

    Raises:
        CalibrationError: an angle is not finite.
        ArgumentError: an angle is beyond a turn (2 pi): degrees.
    """

def homography_from_points(
    image_points: ArrayLike, ground_points: ArrayLike
) -> tuple[NDArray[np.float64], NDArray[np.float64]]:
    """The homography that takes points of the ground to the pixels that see them.

    Of four points the one that does so exactly, of more the one with the least sum of squared distances in the image: a
    direct linear transform of normalised points (Hartley and Zisserman, Multiple View Geometry, algorithm 4.2), then
    Levenberg-Marquardt. `Lut.from_ground_points` goes on to the bird's-eye view.

    Args:
        image_points: (N, 2) pixels (u, v), N of 4 or more.
        ground_points: (N, 2) the same points on the ground, metres.

    Returns:
        image_from_ground: (3, 3) float64, takes (x, y, 1) to a pixel. Its third component is positive at the points, so
            that it is 0 or less behind the camera; divide by `image_from_ground[2, 2]` to compare with OpenCV's.
        errors: (N,) float64, pixels from each point to where the homography puts it. One that stands out is misplaced.

    Raises:
        ArgumentError: fewer than four points, points that coincide or of which all but one lie on a line (of four: three
            do), or no camera has all of them in front of it: pairs are mixed up.
        CalibrationError: a coordinate is not finite.
    """

def vanishing_point(lines: ArrayLike, *, camera: Camera | None = None) -> tuple[float, float]:
    """The pixel where lines meet, such as lane markings: see `Camera.from_vanishing_point`.

    Of two lines their intersection; of more the point with the least sum of squared distances from them. Through a camera,
    each line is the plane of its two rays, and the result the pixel of the direction that lies in all planes: of more than
    two, the one with the least sum of squared sines of its angles to them.

    Args:
        lines: (N, 2, 2), two points (u, v) of each line, far apart.
        camera: a camera whose lens bends the lines of the raw picture; its pose does not matter. None takes the lines as
            straight, which those of a pinhole are.

    Returns:
        (u, v), a pixel of the same picture, also outside it.

    Raises:
        ArgumentError: fewer than two lines, all parallel, both points of one in the same place, or a point beyond the
            lens.
        CalibrationError: a coordinate is not finite.
    """

def flip_handedness(points: ArrayLike) -> NDArray[np.float64]:
    """Points (x, y, z) -> (x, -y, z): from a left-handed frame (CARLA, Unreal: y right) to ISO 8855, or back.

    Args:
        points: (N, 3).

    Returns:
        (N, 3) float64, a new array.

    Raises:
        ArgumentError, ArgumentTypeError: the shape or the type is wrong.
    """

def flip_handedness_euler(roll: float, pitch: float, yaw: float) -> tuple[float, float, float]:
    """Euler angles (roll, pitch, yaw) -> (roll, -pitch, -yaw), in any unit; its own inverse.

    The left-handed angles are CARLA's (positive pitch lifts the nose, positive yaw turns right), the right-handed those
    of `rotation_from_euler`.

    Raises:
        CalibrationError, ArgumentTypeError: an angle is not finite, or no number.
    """

def flip_handedness_rotation(R: ArrayLike) -> NDArray[np.float64]:
    """A rotation `S R S` with `S = diag(1, -1, 1)`; its own inverse.

    Args:
        R: (3, 3) rotation.

    Raises:
        CalibrationError: it is not a rotation (a determinant of -1 means that only one of its frames is left-handed).
    """

def flip_handedness_pose(T: ArrayLike) -> NDArray[np.float64]:
    """A pose `S T S` with `S = diag(1, -1, 1, 1)`: both of its frames change hand; its own inverse.

    Args:
        T: (4, 4) rigid transform between two frames of the same hand.

    Raises:
        CalibrationError: it is not rigid. A determinant of -1 means that one frame only is left-handed: mirror that one,
            `T @ diag(1, -1, 1, 1)` for the source frame.
    """

def rasterize(
    points: ArrayLike,
    grid: BevGrid,
    values: ArrayLike | None = None,
    reduce: str | Sequence[str] = ("count", "max", "mean"),
    *,
    slices: Sequence[float] | None = None,
    density_full: float = 64.0,
    threads: int | None = None,
) -> Layers:
    """Collects points in the cells of a grid: counts, heights, and whatever else the points carry.

    A point's cell is `row = floor((x_max - x) / dx)`, `column = floor((y_max - y) / dy)` in float64: points on the far
    and on the left edge of the grid (x_max, y_max) are in, those on the near and on the right edge (x_min, y_min) are
    out. A cell is the same square whatever the grid's `sample_at`, which says where images are sampled.

    Args:
        points: (N, 3) or wider, or (H, W, 3) of an organised cloud: x, y, z in metres in the vehicle frame; further columns
            are not looked at. float32 or float64, any strides, without a copy. (N, 2) will do where no z is needed.
        grid: the cells.
        values: what to collect instead of z: (N,) or (N, C), or (H, W) or (H, W, C), as `points[:, 3]`. bool, integers,
            float32 or float64, any strides.
        reduce: one name, or several:
            "count" (how many points), "density" (`min(1, log(count + 1) / log(density_full))`), "min", "max", "mean" (a
            float64 sum in the order of the points), "last" (of the last point), "top" (of the point with the greatest z,
            the first of several).
        slices: edges of height slices, ascending; slice s takes `slices[s] <= z < slices[s + 1]`.
        density_full: the count plus one at which the density is 1.
        threads: at most how many threads; the result does not depend on it, to the last bit.

    Returns:
        A dict of the layers, in the order of `reduce`: "count" int32 and "density" float32 of (rows, columns), 0 in empty
        cells; the others of (rows, columns), or (rows, columns, C) for values with channels, NaN in empty cells, of the
        dtype of z or the values (float32 for bool and integers of 8 and 16 bits, float64 for wider ones). With slices,
        there is an axis of them in front. Its attributes `inside`, `outside` and `ignored` say what became of the points:
        ignored are those with a coordinate that is NaN or infinite, and those on the grid with such a value; they
        take part in nothing.

        Besides the layers, memory is needed for what the cells collect while it runs: 4 bytes for each for counts, 16
        or 24 for each channel (24 or 40 in float64), 8 for "top"; and for at most 64 MiB of points with several threads.

    Raises:
        ArgumentError: shapes that do not fit, an unknown name, slices that do not ascend, more than 2^31 - 1 points, more
            than 2^28 cells in all slices.
        DtypeError: points that are not float32 or float64, values that are not real.
        ArgumentTypeError: not an array, not a grid.
        OutOfMemoryError: the layers do not fit.
    """

def rasterize_boxes(
    boxes: ArrayLike,
    grid: BevGrid,
    labels: Sequence[int] | NDArray[np.integer[Any]] | None = None,
    *,
    background: int = 0,
    out: NDArray[np.int32] | None = None,
) -> NDArray[np.int32]:
    """Gives a label to the cells whose centres are inside of boxes; later boxes win.

    The centre is that of the cell's square, whatever the grid's `sample_at`.

    Args:
        boxes: (N, 5): x, y of the centre, length (along the heading), width, all in metres; yaw in radians, positive to
            the left, 0 along +x.
        grid: the cells.
        labels: one for each box; by default 1, 2, 3, ...
        background: the label of all other cells.
        out: where to draw, (rows, columns) int32; what is outside the boxes stays.

    Returns:
        (rows, columns) int32.

    Raises:
        ArgumentError: a number that is not finite or beyond 1e9 m, a negative size, shapes or numbers that do not fit.
        ArgumentTypeError, DtypeError: the wrong type.
    """

def rasterize_polygons(
    polygons: Sequence[ArrayLike],
    grid: BevGrid,
    labels: Sequence[int] | NDArray[np.integer[Any]] | None = None,
    *,
    background: int = 0,
    out: NDArray[np.int32] | None = None,
) -> NDArray[np.int32]:
    """Gives a label to the cells whose centres are inside of polygons; later polygons win.

    Inside is what an odd number of edges separates from far away (the even-odd rule): any winding will do, and where a
    polygon crosses itself, what it surrounds twice is outside. A centre on an edge belongs to the side that is nearer or
    to the right of it, so polygons that share an edge share no cell and leave none out. Holes: draw them afterwards
    with the label of the background.

    Args:
        polygons: a list of (M, 2) arrays: x, y of at least 3 corners in metres; the last is joined to the first.
        grid: the cells.
        labels: one for each polygon; by default 1, 2, 3, ...
        background: the label of all other cells.
        out: where to draw, (rows, columns) int32; what is outside the polygons stays.

    Returns:
        (rows, columns) int32.

    Raises:
        ArgumentError: fewer than 3 corners, a corner that is not finite or beyond 1e9 m, shapes or numbers that do not fit.
        ArgumentTypeError, DtypeError: the wrong type.
    """

def remap(
    image: NDArray[Any],
    map_x: NDArray[np.floating[Any]] | NDArray[np.int16],
    map_y: NDArray[np.floating[Any]] | NDArray[np.uint16] | None,
    *,
    interpolation: Literal["nearest", "bilinear", "cubic", "lanczos4"] = "bilinear",
    border_mode: _BorderMode | Literal["transparent"] = "constant",
    border_value: float | Sequence[float] = 0,
    out: NDArray[Any] | None = None,
    threads: int | None = None,
) -> NDArray[Any]:
    """Warps an image by maps, as `cv2.remap`: cell (i, j) samples (map_x[i, j], map_y[i, j]).

    For maps that are used once; a `Lut` of them is faster from the second frame on. Floats are blended by the maps'
    numbers as they are, within 2^-20 of the range of the four pixels; a `Lut` keeps steps of 1/32768 pixel.

    Args:
        image: (H, W) or (H, W, C), as `Lut.warp` takes it.
        map_x: (rows, columns) float32 or float64, source columns in pixels. NaN and infinity give the border value in
            every mode. Or int16 pairs, as `Lut.from_maps` takes them.
        map_y: the same for source rows, or uint16 beside int16 pairs.
        interpolation: "nearest", "bilinear", "cubic" (4 x 4 pixels, a = -0.75) or "lanczos4" (8 x 8), as OpenCV defines them; the
            last two overshoot beside edges, and integers are rounded to nearest, halves up, and clipped to their range.
        border_mode: what lies beyond the image: "constant" (the border value), "replicate" (aaa|abcd|ddd), "reflect"
            (cba|abcd|dcb), "reflect_101" (dcb|abcd|cba), "wrap" (bcd|abcd|abc), or "transparent": cells that sample
            outside the rectangle of pixel centres keep what `out` holds, which must be given.
        border_value: for "constant": a number, or one for each channel.
        out: where to write, of the image's dtype and the result's shape.
        threads: at most how many threads; the result does not depend on it.

    Returns:
        (rows, columns) or (rows, columns, C) of the image's dtype.

    Raises:
        LutError, DtypeError: the maps are wrong or differ.
        ImageError, ArgumentError, ArgumentTypeError: as `Lut.warp`.
    """

def warp_perspective(
    image: NDArray[Any],
    M: ArrayLike,
    dsize: Sequence[int],
    *,
    interpolation: Literal["nearest", "bilinear", "cubic", "lanczos4"] = "bilinear",
    inverse_map: bool = False,
    border_mode: _BorderMode | Literal["transparent"] = "constant",
    border_value: float | Sequence[float] = 0,
    out: NDArray[Any] | None = None,
    threads: int | None = None,
) -> NDArray[Any]:
    """Warps an image by a homography, as `cv2.warpPerspective`.

    Floats are blended by exact coordinates, as `remap` does it.

    Args:
        image: (H, W) or (H, W, C), as `Lut.warp` takes it.
        M: (3, 3), from source pixel to output pixel (from output to source with `inverse_map`). Points behind a camera
            are not culled, because a homography's sign is arbitrary: `Lut(camera, grid)` does that.
        dsize: (width, height) of the output.
        interpolation: as in `remap`.
        inverse_map: M maps output to source, `cv2.WARP_INVERSE_MAP`.
        border_mode: what lies beyond the image, as in `remap`.
        border_value: for "constant": a number, or one for each channel.
        out: where to write, of the image's dtype and the result's shape.
        threads: at most how many threads; the result does not depend on it.

    Returns:
        (height, width) or (height, width, C) of the image's dtype.

    Raises:
        LutError: M is singular or not finite.
        ImageError, DtypeError, ArgumentError, ArgumentTypeError: as `Lut.warp`.
    """

@final
class PixelRays:
    """The rays of a camera's pixels, worked out once: for many depth images behind one lens.

    `points_from_depth(depth, rays)` gives what `points_from_depth(depth, camera)` does, to the last bit, without the
    iterations that a lens takes for every pixel. A pinhole gains nothing. Immutable, comparable (by its camera),
    hashable, picklable (it is worked out again).
    """

    def __new__(cls, camera: Camera, *, threads: int | None = None) -> PixelRays:
        """The rays of every pixel, 24 bytes each.

        Args:
            camera: any lens.
            threads: at most how many threads; the result does not depend on it.

        Raises:
            ArgumentError: the image has more than 2^28 pixels.
            ArgumentTypeError: it is no `Camera`.
        """
    @property
    def camera(self) -> Camera:
        """The camera whose they are."""
    @property
    def nbytes(self) -> int:
        """Bytes of the table."""
    def __hash__(self) -> int: ...
    def __eq__(self, other: object, /) -> bool: ...
    def __ne__(self, other: object, /) -> bool: ...
    def __reduce__(self) -> tuple[Any, ...]: ...

def decode_carla_depth(
    image: NDArray[np.uint8],
    *,
    order: Literal["bgra", "rgba", "bgr", "rgb"] | None = None,
    normalized: bool = False,
    out: NDArray[np.float32] | None = None,
    threads: int | None = None,
) -> NDArray[np.float32]:
    """CARLA's colour-coded depth to metres: `(R + 256 G + 65536 B) / (256^3 - 1) * 1000`, planar depth (z).

    Every value is the exact one, rounded once to float32. Source: CARLA's documentation of its depth camera.

    Args:
        image: (H, W, 4) or (H, W, 3) uint8, any row stride. `np.frombuffer(sensor_image.raw_data, np.uint8)`, reshaped to
            (height, width, 4), is CARLA's own buffer.
        order: of the channels. Four are "bgra" if nothing is said, as CARLA's buffers and OpenCV have them; three must
            be named, "bgr" (OpenCV) or "rgb" (Pillow), because the wrong one gives other depths without complaint.
        normalized: 0 to 1 instead of metres. It keeps every code apart; float32 metres beyond 512 m do not.
        out: where to write, (H, W) float32.
        threads: at most how many threads; the result does not depend on it.

    Returns:
        (H, W) float32, 0 to 1000; the sky is 1000.

    Raises:
        ImageError, DtypeError: the shape or the dtype of the image or of `out` is wrong.
        ArgumentError, ArgumentTypeError: another argument is wrong, or three channels have no order.
    """

def encode_carla_depth(
    depth: NDArray[np.floating[Any]],
    *,
    order: Literal["bgra", "rgba", "bgr", "rgb"] = "bgra",
    normalized: bool = False,
    out: NDArray[np.uint8] | None = None,
    threads: int | None = None,
) -> NDArray[np.uint8]:
    """Depth to CARLA's colour code, the nearest of its 2^24 steps of 0.06 mm; the way back of `decode_carla_depth`.

    Args:
        depth: (H, W) float32 or float64, metres from 0. What is 1000 m or farther, infinity too, becomes the largest
            code, as the sky has it.
        order: of the channels; alpha is 255.
        normalized: `depth` is 0 to 1 instead.
        out: where to write, (H, W, 4) or (H, W, 3) of uint8, with any row stride. Where a number turns out to be negative
            or NaN, a part of it has been written.
        threads: at most how many threads.

    Returns:
        (H, W, 4) or (H, W, 3) uint8.

    Raises:
        ImageError: a number is negative or NaN (the message says where), or the shape is not (H, W).
        DtypeError, ArgumentError, ArgumentTypeError: another argument is wrong.
    """

@overload
def points_from_depth(
    depth: NDArray[Any],
    K: Camera | PixelRays | ArrayLike,
    max_depth: float | None = None,
    frame: Literal["camera", "flu", "vehicle"] | ArrayLike = "camera",
    *,
    order: Literal["bgra", "rgba", "bgr", "rgb"] | None = None,
    min_depth: float | None = None,
    kind: Literal["z", "ray"] = "z",
    depth_scale: float | None = None,
    stride: int = 1,
    mask: NDArray[np.bool_] | NDArray[np.uint8] | None = None,
    compact: Literal[False] = False,
    values: None = None,
    dtype: DTypeLike = "float32",
    out: NDArray[np.floating[Any]] | None = None,
    threads: int | None = None,
) -> NDArray[Any]:
    """Back-projects a depth image: a point for each pixel, in metres.

    `points_from_depth(depth, K)` does the usual: planar depth in metres to points of the optical frame. With pixel
    (u, v) counted from the centre of the top-left pixel, `(X, Y, Z) = ((u - cx) d / fx, (v - cy) d / fy, d)`; every
    coordinate is worked out in float64 and rounded once.

    A pixel has no point, and NaN for all three, where its depth is 0, negative, NaN or infinite (no return), nearer than
    `min_depth`, farther than `max_depth`, where `mask` is False, or where the lens sees nothing.

    Args:
        depth: (H, W) float32 or float64, or uint16 with `depth_scale`; or with `order` a colour-coded image of CARLA's,
            (H, W, 4 or 3) uint8. Any row stride.
        K: a `Camera` with any lens, its `image_size` that of `depth`; its `PixelRays`, for many images behind one
            lens; or the (3, 3) matrix K of a pinhole. A K whose principal point is counted from the corner (CARLA's
            w / 2) loses 0.5 first.
        max_depth: metres, as `depth` measures; what is exactly there is kept.
        order: the channels of CARLA's image, "bgra" as its buffers are, "rgba", "bgr" or "rgb": the points of
            `points_from_depth(decode_carla_depth(depth, order=order), ...)`, bit for bit, in one pass.
        min_depth: as `max_depth`.
        frame: "camera" (optical: x right, y down, z forward), "flu" (the same camera as x forward, y left, z up),
            "vehicle" (with the pose of a `Camera`), or a (4, 4) pose `dst_from_camera` of a world or another sensor,
            the camera's frame being the optical one.
        kind: what `depth` measures: "z", planar depth (CARLA, RGB-D cameras), or "ray", the distance from the optical
            centre (range images, fisheyes beyond 180 degrees).
        depth_scale: metres per unit; 1 for floats, and never guessed for uint16: 0.001 for millimetres, 1 / 5000 for
            TUM, 1 / 256 for KITTI.
        stride: every so many-th row and column, from the first.
        mask: (H, W) bool or uint8; points only where it is not 0.
        compact: the points that there are, (N, 3), with the pixels that they come from.
        values: with `compact`, what to gather beside the points: an array (H, W) or (H, W, C) of any dtype (colours,
            labels), or a tuple of them.
        dtype: of the points, float32 or float64.
        out: where to write, (H', W', 3) of `dtype`; not with `compact`.
        threads: at most how many threads; the result does not depend on it.

    Returns:
        (H', W', 3), where H' is H / stride rounded up: points[i, j] belongs to depth[i * stride, j * stride].
        With `compact`: points (N, 3); index (N,) int64, `row * W + column`, so that `image.reshape(-1, 3)[index]` are
        their colours; and with `values` those, (N,) or (N, C), or a tuple.

    Raises:
        ImageError, DtypeError: a shape or a dtype is wrong, or a size is not the camera's.
        CalibrationError: K is no pinhole matrix (singular, not finite), or the pose is not rigid.
        ArgumentError, ArgumentTypeError: another argument is wrong.
    """

@overload
def points_from_depth(
    depth: NDArray[Any],
    K: Camera | PixelRays | ArrayLike,
    max_depth: float | None = None,
    frame: Literal["camera", "flu", "vehicle"] | ArrayLike = "camera",
    *,
    order: Literal["bgra", "rgba", "bgr", "rgb"] | None = None,
    min_depth: float | None = None,
    kind: Literal["z", "ray"] = "z",
    depth_scale: float | None = None,
    stride: int = 1,
    mask: NDArray[np.bool_] | NDArray[np.uint8] | None = None,
    compact: Literal[True],
    values: None = None,
    dtype: DTypeLike = "float32",
    out: None = None,
    threads: int | None = None,
) -> tuple[NDArray[Any], NDArray[np.int64]]: ...
@overload
def points_from_depth(
    depth: NDArray[Any],
    K: Camera | PixelRays | ArrayLike,
    max_depth: float | None = None,
    frame: Literal["camera", "flu", "vehicle"] | ArrayLike = "camera",
    *,
    order: Literal["bgra", "rgba", "bgr", "rgb"] | None = None,
    min_depth: float | None = None,
    kind: Literal["z", "ray"] = "z",
    depth_scale: float | None = None,
    stride: int = 1,
    mask: NDArray[np.bool_] | NDArray[np.uint8] | None = None,
    compact: Literal[True],
    values: NDArray[Any],
    dtype: DTypeLike = "float32",
    out: None = None,
    threads: int | None = None,
) -> tuple[NDArray[Any], NDArray[np.int64], NDArray[Any]]: ...
@overload
def points_from_depth(
    depth: NDArray[Any],
    K: Camera | PixelRays | ArrayLike,
    max_depth: float | None = None,
    frame: Literal["camera", "flu", "vehicle"] | ArrayLike = "camera",
    *,
    order: Literal["bgra", "rgba", "bgr", "rgb"] | None = None,
    min_depth: float | None = None,
    kind: Literal["z", "ray"] = "z",
    depth_scale: float | None = None,
    stride: int = 1,
    mask: NDArray[np.bool_] | NDArray[np.uint8] | None = None,
    compact: Literal[True],
    values: Sequence[NDArray[Any]],
    dtype: DTypeLike = "float32",
    out: None = None,
    threads: int | None = None,
) -> tuple[NDArray[Any], NDArray[np.int64], tuple[NDArray[Any], ...]]: ...
def depth_to_lidar(
    normalized_depth: ArrayLike, w: int, h: int, K: ArrayLike, max_depth: float = 0.9
) -> tuple[NDArray[np.float64], NDArray[Any]]:
    """The published function of this name, value for value, except that the input is left alone.

    For what was built on it. It reverses rows and columns by `w - 1 - u - cx` with K as CARLA gives it (`cx = w / 2`),
    which is half a pixel off: everything is `0.5 z / f` too far right and down, 0.06 m at 50 m for 800 px and 90 degrees.
    `points_from_depth(depth, camera, frame="flu")` has no such shift and no points at (0, 0, 0).

    Args:
        normalized_depth: (h, w), or flat, 0 to 1 as `decode_carla_depth(image, normalized=True)` gives it; 1 is 1000 m.
        w: columns.
        h: rows.
        K: (3, 3), any invertible matrix.
        max_depth: farther pixels become the point (0, 0, 0); those exactly there, and NaN, stay.

    Returns:
        points: (3, h * w) float64, rows forward, left, up, pixel after pixel.
        metres: (h, w) of the input's dtype (float64 for all but float32), 0 where it was too far.

    Raises:
        CalibrationError: K is singular.
        ImageError, ArgumentError, ArgumentTypeError: another argument is wrong.
    """

@overload
def depth_to_local_point_cloud(
    normalized_depth: ArrayLike, fov: float, *, color: None = None, max_depth: float = 0.9
) -> NDArray[np.float64]:
    """`depth_to_local_point_cloud` of CARLA 0.8.4, value for value.

    For what was built on it; it is half a pixel off as `depth_to_lidar` is. `points_from_depth` is not.

    Args:
        normalized_depth: (h, w), 0 to 1; 1 is 1000 m.
        fov: horizontal field of view, degrees: `f = w / (2 tan(fov pi / 360))`, principal point (w / 2, h / 2).
        color: (h, w, C) of any dtype, gathered alongside.
        max_depth: farther pixels are left out; those exactly there, and NaN, stay.

    Returns:
        (N, 3) float64, rows left, up, forward, in the order of the pixels; with `color` also its (N, C).

    Raises:
        ImageError, DtypeError, ArgumentError, ArgumentTypeError: an argument is wrong.
    """

@overload
def depth_to_local_point_cloud(
    normalized_depth: ArrayLike, fov: float, *, color: NDArray[Any], max_depth: float = 0.9
) -> tuple[NDArray[np.float64], NDArray[Any]]: ...
@overload
def render_points(
    points: ArrayLike,
    camera: Camera,
    *,
    values: None = None,
    radius: float = 0,
    kind: Literal["z", "ray"] = "z",
    min_depth: float | None = None,
    max_depth: float | None = None,
    border_value: float | Sequence[float] = 0,
    threads: int | None = None,
) -> tuple[NDArray[np.float32], NDArray[np.int64]]:
    """Draws points as a camera sees them: a z-buffer, in which each pixel takes the nearest point that falls on it.

    A point falls on the pixel that its own rounds to (halves to even). Of points whose depths are equal in float32 the
    first in `points` wins, so the result does not depend on the number of threads.

    Args:
        points: (N, 3) or wider, of which the first three columns are x, y, z in the vehicle frame; float32 or float64
            with any row stride are not copied. What is not finite is left out.
        camera: any lens.
        values: (N,) or (N, C) of any dtype: colours, labels, intensity; drawn as well.
        radius: a point covers the pixels whose centres lie within so many pixels of its own: 0 that one, 1 a plus of
            five, 1.5 three by three.
        kind: what nearest means and `depth` measures: "z", planar depth, or "ray", the distance from the optical centre.
            With "z" nothing is drawn that lies 90 degrees or more off the axis.
        min_depth: metres; what is nearer is left out.
        max_depth: likewise what is farther.
        border_value: `values` where no point falls, one number or one for each column.
        threads: at most how many threads.

    Returns:
        depth: (H, W) float32, metres, NaN where no point falls.
        index: (H, W) int64, the row of `points` that is seen, -1 where there is none.
        image: with `values`, (H, W) or (H, W, C) of their dtype.

    Raises:
        ArgumentError, ArgumentTypeError, DtypeError: an argument is wrong.
    """

@overload
def render_points(
    points: ArrayLike,
    camera: Camera,
    *,
    values: NDArray[Any],
    radius: float = 0,
    kind: Literal["z", "ray"] = "z",
    min_depth: float | None = None,
    max_depth: float | None = None,
    border_value: float | Sequence[float] = 0,
    threads: int | None = None,
) -> tuple[NDArray[np.float32], NDArray[np.int64], NDArray[Any]]: ...
def cpu_info() -> _CpuInfo:
    """The build, the CPU and the threads: what a bug report needs.

    Raises:
        ArgumentError: the environment variable IPM_RS_ISA names an instruction set that is not available.
    """

def get_num_threads() -> int:
    """How many threads a call uses when it does not say.

    That of `set_num_threads`, else of the environment variable IPM_RS_NUM_THREADS if it is a whole number from 1 to 1024
    (anything else is warned of when the package is imported), else the CPUs that the process may use.
    """

def set_num_threads(n: SupportsIndex) -> None:
    """Sets how many threads a call uses when it does not say, and the most that any call uses.

    Threads beyond that are given back as soon as no call needs them. `threads=` of a call says "at most": larger numbers
    than this one are as good as None.

    Args:
        n: from 1 to 1024.

    Raises:
        ArgumentError, ArgumentTypeError: it is not a whole number from 1 to 1024.
    """

def _mosaic_windows(
    placed: Any, resolution: float, side: int
) -> list[tuple[tuple[int, int], tuple[int, int], BevGrid]]: ...
def _mosaic_shows(
    placed: Any, image: NDArray[Any], window: BevGrid, least: float, threads: int | None
) -> tuple[NDArray[Any], NDArray[np.bool_]]: ...
def _mosaic_shown(
    placed: Any,
    image: NDArray[Any],
    window: BevGrid,
    at: tuple[int, int],
    labels: bool,
    threads: int | None,
) -> tuple[int, tuple[tuple[int, int], NDArray[Any], NDArray[np.uint16], int, int]]: ...
def _mosaic_add(
    tile: tuple[Any, ...],
    waiting: list[tuple[tuple[int, int], NDArray[Any], NDArray[np.uint16], int, int]],
    threads: int | None,
) -> None: ...
def _mosaic_merge(tile: tuple[Any, ...], keys: NDArray[np.uint32], samples: NDArray[Any]) -> None: ...
def _refine_shown(
    looked: Any, rays: NDArray[np.float64], first: Sequence[float], second: Sequence[float], slopes: bool
) -> tuple[NDArray[np.float64], NDArray[np.float64] | None]: ...
def _refine_differences(
    values: NDArray[np.float64],
    there: NDArray[np.float64],
    slopes: NDArray[np.float64] | None,
    spread: float | None,
) -> tuple[NDArray[np.float64], NDArray[np.float64] | None, NDArray[np.bool_]]: ...
def _refine_normal(
    off: NDArray[np.float64], slopes: NDArray[np.float64], spread: float
) -> tuple[float, NDArray[np.float64], NDArray[np.float64]]: ...
