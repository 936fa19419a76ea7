//! Memory of other libraries as NumPy arrays: tensors, buffers, whatever shares what it holds without a copy.

use numpy::{PyArrayDescrMethods, PyUntypedArray, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyMemoryView};

use super::arrays;
use super::convert::{tuple_text, type_name};
use super::error::classes::{ArgumentTypeError, DtypeError};
use super::error::{OrRefuse, about_argument, error_text};

/// DLPack's device types whose memory the CPU reaches, as NumPy lists them: CPU, CUDA host, ROCm host, CUDA managed.
const HOST_DEVICES: [i64; 4] = [1, 3, 11, 13];

/// The array of an argument: the object itself if it is one, else a view of the memory that it shares. Its Python code
/// runs here.
///
/// # Errors
/// `ArgumentError` for a masked array.
/// `ArgumentTypeError` where the memory is on another device or cannot be had without a copy.
pub(super) fn array<'py>(
    name: &str,
    object: &Bound<'py, PyAny>,
    writable: bool,
) -> PyResult<Bound<'py, PyUntypedArray>> {
    let array = match object.cast::<PyUntypedArray>() {
        Ok(array) => array.clone(),
        Err(_) => shared(name, object, writable)?,
    };
    arrays::own_class(name, array)
}

/// A way to an array, if the object offers it.
type Way = for<'py> fn(&Bound<'py, PyAny>) -> PyResult<Option<Bound<'py, PyUntypedArray>>>;

#[cold]
fn shared<'py>(name: &str, object: &Bound<'py, PyAny>, writable: bool) -> PyResult<Bound<'py, PyUntypedArray>> {
    let py = object.py();
    if object.is_none() {
        let got = arrays::described(object)?;
        return Err(ArgumentTypeError::new_err(format!("{name}: expected an array, got {got}")));
    }
    check_device(name, object)?;
    // DLPack hands out read-only memory where the producer or NumPy are older than its version 1; NumPy's own protocols
    // know whether it may be written to. They, in turn, are not everywhere.
    let ways: [Way; 2] = if writable { [by_numpy, by_dlpack] } else { [by_dlpack, by_numpy] };
    let (mut found, mut problem) = (None, None);
    for way in ways {
        match way(object) {
            Ok(Some(array)) if !writable || is_writable(&array)? => {
                found = Some(array);
                break;
            }
            Ok(array) => found = found.or(array),
            Err(error) => problem = problem.or(Some(about_argument(py, error)?)),
        }
    }
    match (found, problem) {
        (Some(array), _) if array.ndim() >= 2 => Ok(array),
        (Some(array), _) => Err(ArgumentTypeError::new_err(format!(
            "{name}: expected an array with rows and columns, got {} of shape {}; use numpy.frombuffer({name}, dtype).reshape(shape)",
            type_name(object),
            tuple_text(array.shape())
        ))),
        (None, None) => {
            let got = arrays::described(object)?;
            let mend = if got.contains(';') { String::new() } else { format!("; use numpy.asarray({name})") };
            Err(ArgumentTypeError::new_err(format!(
                "{name}: expected a NumPy array or memory that is shared as one (DLPack, buffer protocol), got {got}{mend}"
            )))
        }
        (None, Some(_)) if is_bfloat16(object)? => Err(DtypeError::new_err(format!(
            "{name}: expected a dtype that NumPy has, got bfloat16; use {name}.float() for float32"
        ))),
        (None, Some(_)) if requires_grad(object)? => Err(ArgumentTypeError::new_err(format!(
            "{name}: expected values, got {} that requires grad, and arrays carry no gradients; ipm_rs.torch.Warp does, \
             or use {name}.detach()",
            type_name(object)
        ))),
        (None, Some(problem)) => {
            let why = error_text(py, &problem)?;
            let error = ArgumentTypeError::new_err(format!(
                "{name}: expected a NumPy array or memory that is shared as one, got {}: {why}",
                type_name(object)
            ));
            error.set_cause(py, Some(problem));
            Err(error)
        }
    }
}

/// Whether it calls its dtype so, as tensors do: NumPy has no such numbers, and the errors of the export do not say it.
fn is_bfloat16(object: &Bound<'_, PyAny>) -> PyResult<bool> {
    let name = object.getattr("dtype").and_then(|dtype| dtype.str()).or_none(object.py())?;
    Ok(name.is_some_and(|name| name.to_string_lossy().ends_with("bfloat16")))
}

/// Whether it says that gradients are to flow through it, as tensors of PyTorch do.
fn requires_grad(object: &Bound<'_, PyAny>) -> PyResult<bool> {
    let requires = object.getattr("requires_grad").and_then(|requires| requires.extract::<bool>());
    Ok(requires.or_none(object.py())?.unwrap_or(false))
}

/// Whether its class is one of PyTorch's.
fn is_torch(object: &Bound<'_, PyAny>) -> PyResult<bool> {
    let module = object.get_type().getattr("__module__").and_then(|module| module.extract::<String>());
    Ok(module.or_none(object.py())?.is_some_and(|module| module.split('.').next() == Some("torch")))
}

/// Refuses memory of a device that the CPU does not reach.
fn check_device(name: &str, object: &Bound<'_, PyAny>) -> PyResult<()> {
    let py = object.py();
    let device =
        object.getattr_opt("__dlpack_device__").and_then(|method| method.map(|method| method.call0()).transpose());
    // if it is broken, so is the export, and that says why
    let Some(device) = device.or_none(py)?.flatten() else { return Ok(()) };
    match device.extract::<(i64, i64)>().or_none(py)? {
        Some((kind, _)) if !HOST_DEVICES.contains(&kind) => {
            let or_torch = if is_torch(object)? { ", or ipm_rs.torch.Warp, which warps on every device" } else { "" };
            Err(ArgumentTypeError::new_err(format!(
                "{name}: expected memory of the CPU, got {} on another device (DLPack device type {kind}); use \
                 {name}.cpu(){or_torch}",
                type_name(object)
            )))
        }
        _ => Ok(()),
    }
}

fn by_dlpack<'py>(object: &Bound<'py, PyAny>) -> PyResult<Option<Bound<'py, PyUntypedArray>>> {
    if !object.hasattr("__dlpack__")? {
        return Ok(None);
    }
    let array = object.py().import("numpy")?.call_method1("from_dlpack", (object,))?;
    Ok(array.cast_into::<PyUntypedArray>().ok())
}

/// By the buffer protocol, `__array_interface__`, `__array_struct__` or `__array__`, if that is not a copy.
fn by_numpy<'py>(object: &Bound<'py, PyAny>) -> PyResult<Option<Bound<'py, PyUntypedArray>>> {
    let is_buffer = || PyMemoryView::from(object).or_none(object.py()).map(|view| view.is_some());
    let mut shares = !object.is_instance_of::<PyBytes>() && is_buffer()?;
    for protocol in ["__array_interface__", "__array_struct__", "__array__"] {
        shares = shares || object.hasattr(protocol)?;
    }
    if !shares {
        return Ok(None);
    }
    let numpy = object.py().import("numpy")?;
    let asarray = || -> PyResult<_> { Ok(numpy.call_method1("asarray", (object,))?.cast_into::<PyUntypedArray>()?) };
    // NumPy 1 cannot be asked not to copy, and NumPy 2 passes the question on to objects that do not know it. But two
    // copies cannot be in one place at a time.
    let (array, again) = (asarray()?, asarray()?);
    let same = address(&array)? == address(&again)?;
    Ok(Some(array).filter(|array| same && array.dtype().kind() != b'O'))
}

fn address(array: &Bound<'_, PyUntypedArray>) -> PyResult<(usize, bool)> {
    array.getattr("__array_interface__")?.get_item("data")?.extract()
}

fn is_writable(array: &Bound<'_, PyUntypedArray>) -> PyResult<bool> {
    array.getattr("flags")?.getattr("writeable")?.extract()
}
