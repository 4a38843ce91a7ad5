"""The dialog of the knobs: one widget for each entry of the schema, in its order.

After the panel in Figure 11 of Arora et al. 2019.
"""

from collections.abc import Callable
from typing import Any

import adsk.core

from ..logic.knobs import Knob, Widget
from ..logic.layout import FAMILIES, LayoutError
from ..logic.units import from_host, host_unit, to_host

_NO_ICON, _LAST = "", -1


class KnobDialog:
    """Widgets in a command's dialog, and what they say."""

    def __init__(self, inputs: adsk.core.CommandInputs, knobs: tuple[Knob, ...], values: dict[str, Any]) -> None:
        self._inputs = inputs
        self._readers: dict[str, Callable[[], Any]] = {}
        for knob in knobs:
            value = values.get(knob.name, knob.default)
            self._readers[knob.name] = _WIDGETS[knob.widget](inputs, knob, value)
        self._message = inputs.addTextBoxCommandInput("michell_message", "", "", 3, True)

    def values(self) -> dict[str, Any]:
        """The knobs as the widgets show them."""
        return {name: read() for name, read in self._readers.items()}

    def say(self, text: str) -> None:
        """Show a text below the widgets."""
        # Fusion validates again after a change, and this is called from there.
        if self._message.formattedText != text:
            self._message.formattedText = text


def _families(inputs: adsk.core.CommandInputs, knob: Knob, value: Any) -> Callable[[], Any]:
    drop_down = inputs.addDropDownCommandInput(_id(knob), knob.title, adsk.core.DropDownStyles.CheckBoxDropDownStyle)
    drop_down.tooltip = knob.description
    chosen = FAMILIES if value == "all" else (value,) if isinstance(value, str) else value
    items = [drop_down.listItems.add(family, family in chosen, _NO_ICON, _LAST) for family in FAMILIES]

    def read() -> Any:
        names = [family for family, item in zip(FAMILIES, items, strict=True) if item.isSelected]
        return "all" if len(names) == len(FAMILIES) else names[0] if len(names) == 1 else names

    return read


def _per_family(inputs: adsk.core.CommandInputs, knob: Knob, value: Any) -> Callable[[], Any]:
    group = inputs.addGroupCommandInput(_id(knob), knob.title)
    group.tooltip = knob.description
    each = value if isinstance(value, (list, tuple)) else [value] * len(FAMILIES)
    spinners = [
        _spinner(group.children, f"{_id(knob)}_{family}", family, knob, number)
        for family, number in zip(FAMILIES, each, strict=True)
    ]

    def read() -> Any:
        numbers = [spinner.value for spinner in spinners]
        return numbers[0] if len(set(numbers)) == 1 else numbers

    return read


def _whole(inputs: adsk.core.CommandInputs, knob: Knob, value: Any) -> Callable[[], Any]:
    spinner = _spinner(inputs, _id(knob), knob.title, knob, value)
    return lambda: spinner.value


def _spinner(
    inputs: adsk.core.CommandInputs, name: str, title: str, knob: Knob, value: int
) -> adsk.core.IntegerSpinnerCommandInput:
    if knob.lowest is None or knob.highest is None:
        raise LayoutError(f"knobs.json gives no bounds for '{knob.name}': update the add-in.")
    spinner = inputs.addIntegerSpinnerCommandInput(name, title, int(knob.lowest), int(knob.highest), 1, int(value))
    spinner.tooltip = knob.description
    return spinner


def _number(inputs: adsk.core.CommandInputs, knob: Knob, value: Any) -> Callable[[], Any]:
    """A number in the document's units; 0 stands for none where there may be none."""
    initial = adsk.core.ValueInput.createByReal(to_host(value or 0.0, knob.unit))
    box = inputs.addValueInput(_id(knob), knob.title, host_unit(knob.unit), initial)
    optional = knob.widget is Widget.OPTIONAL_NUMBER
    box.tooltip = f"{knob.description} 0: not given." if optional else knob.description

    def read() -> float | None:
        if not box.isValidExpression:
            raise LayoutError(f"{knob.title}: '{box.expression}' is not a number.")
        return None if optional and box.value == 0 else from_host(box.value, knob.unit)

    return read


def _choice(inputs: adsk.core.CommandInputs, knob: Knob, value: Any) -> Callable[[], Any]:
    drop_down = inputs.addDropDownCommandInput(_id(knob), knob.title, adsk.core.DropDownStyles.TextListDropDownStyle)
    drop_down.tooltip = knob.description
    for choice in knob.choices:
        drop_down.listItems.add(choice, choice == value, _NO_ICON, _LAST)
    return lambda: drop_down.selectedItem.name


def _flag(inputs: adsk.core.CommandInputs, knob: Knob, value: Any) -> Callable[[], Any]:
    box = inputs.addBoolValueInput(_id(knob), knob.title, True, _NO_ICON, bool(value))
    box.tooltip = knob.description
    return lambda: box.value


def _id(knob: Knob) -> str:
    return f"michell_{knob.name}"


_WIDGETS: dict[Widget, Callable[[adsk.core.CommandInputs, Knob, Any], Callable[[], Any]]] = {
    Widget.FAMILIES: _families,
    Widget.PER_FAMILY: _per_family,
    Widget.WHOLE: _whole,
    Widget.NUMBER: _number,
    Widget.OPTIONAL_NUMBER: _number,
    Widget.CHOICE: _choice,
    Widget.FLAG: _flag,
}
