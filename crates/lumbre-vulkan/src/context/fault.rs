//! The reason that a driver gives for a lost device (VK_EXT_device_fault).

use ash::{ext, vk};

/// Maximum number of addresses, and of the vendor's own codes, that are reported.
const MAX_ENTRIES: usize = 8;

/// Returns what the driver reports of the fault that lost a device, in one line; `None` if it
/// reports nothing.
pub(super) fn report(functions: &ext::device_fault::Device, device: vk::Device) -> Option<String> {
    let mut addresses = [vk::DeviceFaultAddressInfoEXT::default(); MAX_ENTRIES];
    let mut codes = [vk::DeviceFaultVendorInfoEXT::default(); MAX_ENTRIES];
    let mut counts = vk::DeviceFaultCountsEXT::default()
        .address_info_count(MAX_ENTRIES as u32)
        .vendor_info_count(MAX_ENTRIES as u32);
    let mut info = vk::DeviceFaultInfoEXT {
        p_address_infos: addresses.as_mut_ptr(),
        p_vendor_infos: codes.as_mut_ptr(),
        ..Default::default()
    };
    // SAFETY: the device was opened with the extension and is lost; the arrays have room for the
    // stated numbers of entries and live through the call.
    let result =
        unsafe { (functions.fp().get_device_fault_info_ext)(device, &mut counts, &mut info) };
    if !matches!(result, vk::Result::SUCCESS | vk::Result::INCOMPLETE) {
        return None;
    }
    let addresses = &addresses[..MAX_ENTRIES.min(counts.address_info_count as usize)];
    let codes = &codes[..MAX_ENTRIES.min(counts.vendor_info_count as usize)];
    let description = info.description_as_c_str().unwrap_or_default();
    line(&description.to_string_lossy(), addresses, codes)
}

/// Combines what a driver reports of a fault; `None` if that is nothing.
fn line(
    description: &str,
    addresses: &[vk::DeviceFaultAddressInfoEXT],
    codes: &[vk::DeviceFaultVendorInfoEXT],
) -> Option<String> {
    let mut parts = vec![description.trim().to_owned()];
    parts.extend(addresses.iter().map(|a| {
        let kind = match a.address_type {
            vk::DeviceFaultAddressTypeEXT::READ_INVALID => "invalid read at",
            vk::DeviceFaultAddressTypeEXT::WRITE_INVALID => "invalid write at",
            vk::DeviceFaultAddressTypeEXT::EXECUTE_INVALID => "invalid execution at",
            _ => "instruction at",
        };
        format!("{kind} {:#x}", a.reported_address)
    }));
    parts.extend(codes.iter().map(|code| {
        let text = code.description_as_c_str().unwrap_or_default();
        let (number, data) = (code.vendor_fault_code, code.vendor_fault_data);
        format!("{} (code {number:#x}, {data:#x})", text.to_string_lossy())
    }));
    parts.retain(|part| !part.is_empty());
    (!parts.is_empty()).then(|| parts.join("; "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_fault_is_reported_in_one_line() {
        let address = vk::DeviceFaultAddressInfoEXT {
            address_type: vk::DeviceFaultAddressTypeEXT::READ_INVALID,
            reported_address: 0xdead_0000,
            address_precision: 4096,
        };
        let mut code = vk::DeviceFaultVendorInfoEXT {
            vendor_fault_code: 31,
            vendor_fault_data: 2,
            ..Default::default()
        };
        for (to, from) in code.description.iter_mut().zip(b"MMU fault") {
            *to = *from as std::ffi::c_char;
        }
        assert_eq!(
            line(" page fault\n", &[address], &[code]).unwrap(),
            "page fault; invalid read at 0xdead0000; MMU fault (code 0x1f, 0x2)"
        );
        assert_eq!(line("", &[], &[]), None);
    }
}
