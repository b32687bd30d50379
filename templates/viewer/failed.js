// Overwritten in each report: the tests that did not pass.
var dodoFailed = [];
